"""Rewrites logs as another log: of several robots together, or under other names.

`new_numbers` writes the new log, and holds the numbers that events have in it. The caller decides
what becomes of an event: `fleet.join`, `pseudonyms`.
"""
