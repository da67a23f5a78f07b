"""Reads a log: files to segments, segments to pages, pages to events. Takes no lock, only reads.

`segment_scan` opens a segment: a closed one by its summary, a live one by its grammar, message by
message. `reader` reads all segments as one order of events; `following` waits for new commits.
"""
