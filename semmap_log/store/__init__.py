"""The log on disk: a folder of MCAP segments.

May import `core`; knows commits and columns of events, no doors. Start with `writing/writer.py` and
`reading/reader.py`; `byte_layout.py` is the layout, `segment.py` a file being written.
`verification/` checks without trusting `reading/`; `repairing/` repairs.
"""
