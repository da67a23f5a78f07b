"""Values, events, bytes and files: what everything is built on.

Imports nothing of the other rooms. Start with `model/doors.py` and `model/events.py`, then
`model/meaning.py`: the one table of what an event changes. `folds/` folds events to door maps.
"""
