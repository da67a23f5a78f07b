"""Whether sensors can be what is declared of them, by what they read."""
