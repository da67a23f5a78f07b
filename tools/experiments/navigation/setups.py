"""The setups of the experiment: four of the thesis's, and ours."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Setup:
    """What the global planner knows, and in which order goals are gone to."""

    name: str
    """The folder of its runs."""
    title: str
    """As the thesis calls it; a star: no obstacles in the global costmap."""
    obstacles: bool = False
    """The global costmap has an obstacle layer; without, only the local one stops the robot."""
    map: bool = False
    """It has the door layer, and the door sensor keeps its map up to date."""
    smart: bool = False
    """Doors tell the map themselves, when they open or close; no sensor."""
    belief: bool = False
    """P(open) as cost, in place of the state seen last."""
    order: str = "given"
    """`given`: as goals come; `nearest` or `patrol`: chosen out of a window of them."""
    beyond: str = ""
    """What sets it apart, if the thesis does not have it."""


SETUPS = {
    setup.name: setup
    for setup in (
        Setup("no_map", "No Map", obstacles=True),
        Setup("map", "Map", obstacles=True, map=True),
        Setup("no_map_star", "No Map*"),
        Setup("map_star", "Map*", map=True),
        Setup(
            "smart", "Smart", map=True, smart=True,
            beyond="as Map*, but doors report themselves",
        ),
        Setup(
            "belief", "Belief", map=True, belief=True,
            beyond="as Map*, but P(open), learnt from the log, is a cost",
        ),
        Setup(
            "patrol", "Patrol", map=True, belief=True, order="patrol",
            beyond="as Belief, and of ten goals it picks by the patrol planner's order",
        ),
        Setup(
            "nearest_first", "Nearest first", map=True, belief=True, order="nearest",
            beyond="as Belief, and of ten goals it picks the nearest",
        ),
    )
}  # fmt: skip
"""By name; the thesis's first, in its order."""
