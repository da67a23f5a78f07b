"""What `tools/faults.py` does to a log: one file for each kind of fault."""
