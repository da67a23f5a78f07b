"""Other programs' files and topics, into a log and out of it.

May import the rooms below. Start with `importing/importing.py` (files in) and
`exporting/log_files.py` (files out). `formats/` has a file for each format and touches no log;
`topics/translator.py` turns topics into events.
"""
