"""The read model: for each closed segment a table in which the events of one door lie together.

MCAP is the truth. These tables are made of it, can be thrown away at any time, and are used where
they are whole and of this very segment; everything else is read from the log. `segment_tables`
knows the files, `indexing` makes them, `events_about` asks: with or without them it says the same.
"""
