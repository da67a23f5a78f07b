"""A log read: files to segments, segments to pages, pages to events. Takes no lock, writes nothing.

`scan` opens a segment: a closed one by its summary, a live one by its grammar, message by message.
`reader` asks all segments as one order of events; `following` waits for what comes.
"""
