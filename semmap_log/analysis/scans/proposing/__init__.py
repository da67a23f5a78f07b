"""Doors that a map lacks yet, proposed from what a laser saw: scans in, lines with evidence out.

`proposals` is the entry point. A gap of a door's width in a wall, through which beams went, is a
candidate; the visits to it, judged as those to any door of the log, are its evidence.
"""
