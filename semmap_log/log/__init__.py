"""A log of doors: replayed, asked, written, trimmed, rewritten and signed."""
