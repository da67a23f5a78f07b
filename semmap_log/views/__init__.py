"""What people look at: tables, plots, the HTML page, rerun recordings.

May import the rooms below, and each third party in its own edge file only. Start with
`excerpt/span.py`, the part of a log that views draw; then `tables.py`.
"""
