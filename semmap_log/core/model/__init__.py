"""Plain nouns: doors, what happens to them, when, and by whom. Values only, no I/O."""
