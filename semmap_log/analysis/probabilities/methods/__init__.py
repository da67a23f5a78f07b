"""The estimators, a file a method, and their parts.

`schedule` is made of `effective_days` and `habits`, with slots and sensor noise of its own;
`filter` of `schedule`, `belief_history` and `memory`.
"""
