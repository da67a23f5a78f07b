"""The log while it happens: each way in from the outside world is one file here."""
