"""The log on disk: a folder of MCAP segments. The only room that knows MCAP.

`form` says what lies where; `records`, `chunks` and `commits` make the bytes; `segment` holds a
file being written. `scan` opens one for reading: a closed one by its summary (`closed_summary`,
`chunk_table`), a live one by its grammar (`live_scan`, `live_records`, `grammar`, and `resync`
behind damage); `page_reading` and `segment_reading` read from it, `segment_set` tells which files
are the log. `writer` and `reader` are the log as a whole.
"""
