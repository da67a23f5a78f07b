"""The estimators, a file a method; `habits`, `averaging` and `memory` are parts of two of them."""
