"""What a log becomes outside: files of other formats, costmaps, and costmaps over time."""
