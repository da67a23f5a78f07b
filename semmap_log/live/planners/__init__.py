"""What a planner asks of a log: the questions, the oracle that answers them, and the ways to it."""
