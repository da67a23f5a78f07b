"""The guards that `tools/mutations.py` takes out, and how."""
