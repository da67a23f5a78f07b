"""The estimators, a file a method; and their parts.

`schedule` is made of `told_days`, `habits`, `averaging`, `slots`, `effective_days` and
`sensor_noise`; `filter` of that, of `belief_history` and `memory`.
"""
