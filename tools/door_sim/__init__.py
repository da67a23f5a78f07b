"""Doors whose chances are known exactly, to hold estimators against: see `tools/eval_sim_doors.py`."""
