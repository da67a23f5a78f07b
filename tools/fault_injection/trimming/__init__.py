"""Logs from which history was taken out on purpose, against a list from which nothing was."""
