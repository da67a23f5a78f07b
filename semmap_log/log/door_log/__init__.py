"""What a program uses: a log that is asked, and one that is written."""
