"""A log told to others without names: what `export --pseudonymous` writes."""
