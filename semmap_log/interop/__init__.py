"""Other programs' files and topics, into a log and out of it."""
