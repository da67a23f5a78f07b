"""How likely doors are open, from what was seen of them: estimators as folds and functions of time.

`evidence` is what events say about doors, `chain` how states change, `methods` the estimators, and
`belief_fold` joins a method to a log's events. The package uses events and values, never files.
"""
