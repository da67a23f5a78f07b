"""What a program uses: a log to query, and one to write."""
