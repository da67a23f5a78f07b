"""Doors whose chances are known exactly, to hold estimators against: `eval_sim_doors`."""
