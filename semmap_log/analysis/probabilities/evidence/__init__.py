"""What events say about doors: reports, intervals in which a state is known, visits, and tables."""
