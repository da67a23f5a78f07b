"""A log of doors: replayed, queried, written, trimmed, rewritten and signed."""
