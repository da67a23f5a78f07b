"""What else holds what a log holds: caches, copies, scans, and what crashes have left."""
