"""What a planner asks of a log, and how: questions as lines of words, over a socket."""
