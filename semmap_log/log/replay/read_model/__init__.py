"""The read model: for each closed segment a table in which the events of one door lie together.

MCAP is the truth. These tables are made from it, can be deleted at any time, and are used where
they are whole and of this very segment; everything else is read from the log. `indexing` makes
them, `events_about` reads them: the answers are the same with or without them.
"""
