"""How likely doors are open, from what was seen of them: estimators as folds and functions of time.

`evidence` is what the events say about each door, `estimator` what makes forecasts of it, one file
a method; `scores` tell how good they were. The room knows events and values, never a file.
"""
