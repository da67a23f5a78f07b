"""A building's doors and the robot that patrols them: what the shipped recordings are made of.

`habits` makes the truth: when each door really opened and closed. `routes` finds ways over the
floor plan. `robot` drives them and sees what is near. `journal` keeps the commits to be, and
`expected` folds them once more, by hand. `office` and `clinic` tell the two stories.
"""
