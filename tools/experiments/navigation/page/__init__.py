"""The experiment as one page: what it means, its tables and its pictures."""
