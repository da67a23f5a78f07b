"""What a log lets one work out: probabilities, costmaps, rooms, plans, SQL.

May import `core`, `store` and `log`; `costmap_2d/` and `probabilities/` only `core`. Start with
`beliefs/door_beliefs.py` (P(open) of a log) and `probabilities/belief_fold.py` (the estimators),
or `costmaps/level_costmap.py`.
"""
