"""The log on disk: a folder of MCAP segments. The only room that knows MCAP.

`form` says what lies where; `records`, `chunks` and `commits` make the bytes; `segment` holds a
file being written, `scan` one being read; `writer` and `reader` are the log as a whole.
"""
