"""A part of a log as views need it: its events, and what they do to doors, as numpy rows.

`excerpt` says which events stand where, `door_rows` what they do, `door_fold` what becomes of a
door. Recordings for rerun and the report are both made of it; it knows neither.
"""
