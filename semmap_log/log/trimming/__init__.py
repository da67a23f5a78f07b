"""What is taken out of a log on purpose, and how that is recorded: redaction, thinning, expiry."""
