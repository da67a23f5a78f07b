"""Projections over a log: from its start, on from a checkpoint, and live beside a writer.

`fold` gives a state, `live` one after each look at the log; `progress` is what both advance, and
`checkpoint` keeps it in a file.
"""
