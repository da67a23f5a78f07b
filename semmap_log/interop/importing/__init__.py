"""Files into a log."""
