"""Plain nouns: doors, what happens to them, when, and who said so. Values only, no I/O."""
