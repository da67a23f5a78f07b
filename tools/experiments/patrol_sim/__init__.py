"""A building's doors and the robot that patrols them: what the shipped recordings are made of.

`habits` makes the truth, when each door really opened and closed, and `world` holds it. `grid` and
`routes` find ways over the floor plan, `robot` drives them and looks with its `sensor`. `journal`
keeps the commits to be, `expected` folds them once more, by hand. `office` and `clinic` tell the
two stories, the latter with `clinic_people`.
"""
