"""A part of a log as views need it: its events, and their effects on doors, as numpy rows.

`span` defines which events belong to the part and on which plans they are drawn; `door_rows` holds
what they do to doors, and follows each door. Rerun recordings and the report are made of it; it
depends on neither.
"""
