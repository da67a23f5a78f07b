"""How well scans tell doors' states, on logs whose truth is known: parts of `eval_scans.py`."""
