"""Folders that are moved, exchanged, copied over and planted with traps while a log is written."""
