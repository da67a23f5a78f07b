"""Short forms of what `tools/faults.py` does at length."""
