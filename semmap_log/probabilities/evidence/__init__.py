"""What events say about doors: words, stretches in which a state holds, visits, and tables."""
