"""A log of doors: replayed, queried, written, trimmed, rewritten and signed.

May import `core` and `store`. Start with `door_log/door_log.py` (reading) and
`door_log/door_log_writer.py` (writing); `replay/replay.py` computes a state.
"""
