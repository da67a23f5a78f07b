"""A log without names, for others: what `export --pseudonymous` writes."""
