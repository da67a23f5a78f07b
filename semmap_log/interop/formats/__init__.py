"""Foreign formats: one file each, from files to plain values and back. No log is touched here."""
