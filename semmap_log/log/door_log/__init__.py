"""What a program uses: a log that is queried, and one that is written."""
