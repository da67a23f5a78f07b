"""Cases: a costmap drawn anew, and changed door by door."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import cycle, islice
from math import ceil

import numpy as np
from numpy.typing import NDArray

from benchmark import distance_peer, plain_costmap
from benchmark.case import Case, Peer, Work
from benchmark.made_building import RESOLUTION_M, Building, made_building
from benchmark.peers import OURS
from semmap_log.analysis.costmap_2d import costs
from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    LETHAL,
    NO_INFORMATION,
    DoorLayer,
    DoorLine,
)
from semmap_log.analysis.costmap_2d.grid import CellWindow
from semmap_log.analysis.costmap_2d.layered import InflationLayer, LayeredCostmap, StaticLayer

PART = 1000
"""Cells along each edge of the corner of the map that slow peers are given."""
RADIUS_M, SCALING, INSCRIBED_M = 0.55, 10.0, 0.2
INFLATION = {"radius": RADIUS_M, "scaling": SCALING, "inscribed": INSCRIBED_M}
ROUNDS = 5

Grid = NDArray[np.uint8]


def rebuild_case(side: int, rounds: int | None) -> Case:
    """Return: static map, doors and inflation, from nothing to the master.

    Args:
        side: Cells along each edge of the map.
        rounds: Rounds that count; None: `ROUNDS`.
    """
    building = made_building(side)
    share = (PART / side) ** 2
    part = f", 1/{1 / share:.0f} of it" if share < 1 else ""
    peers = (
        Peer(OURS, partial(_ours_anew, side), checksum(plainly_drawn(building, building.doors))),
        Peer(
            f"plain Python{part}",
            partial(_plain_anew, PART),
            checksum(rebuilt(PART)),
            units=share,
        ),
        Peer(f"scipy{_differing_anew(side)}", partial(_scipy, side), 0),
    )
    title = f"Costmap, {named(side)}"
    return Case("costmap", title, "ms", peers, rounds or ROUNDS, memory_promise=False)


def named(side: int) -> str:
    """Return what a map of that size is called."""
    return f"{side} x {side}"


class Costmap:
    """The building's costmap, as a navigation stack has it."""

    def __init__(self, building: Building, doors: Mapping[int, DoorLine]) -> None:
        geometry = building.geometry
        self.doors = DoorLayer(geometry)
        self.doors.draw(doors)
        self.master = LayeredCostmap(
            geometry,
            [
                StaticLayer(geometry, building.costs),
                self.doors,
                InflationLayer(geometry, RADIUS_M, scaling=SCALING, inscribed=INSCRIBED_M),
            ],
        )
        self.master.update()


def rebuilt(side: int) -> Grid:
    """Return the building's master, drawn by us."""
    building = made_building(side)
    return Costmap(building, building.doors).master.costs


def plainly_drawn(building: Building, doors: Mapping[int, DoorLine]) -> Grid:
    """Return a master, drawn by plain loops over its cells."""
    with_doors = plain_costmap.drawn(building.geometry, building.costs, doors.values())
    return plain_costmap.inflated(with_doors, resolution=building.geometry.resolution, **INFLATION)


def checksum(grid: Grid) -> int:
    """Return a number that tells grids apart."""
    return zlib.crc32(np.ascontiguousarray(grid))


def _ours_anew(side: int) -> Work:
    made_building(side)
    return Work(lambda _: rebuilt(side), answer=checksum)


def _plain_anew(side: int) -> Work:
    building = made_building(side)
    return Work(lambda _: plainly_drawn(building, building.doors), answer=checksum)


def _scipy(side: int) -> Work:
    import scipy.ndimage  # type: ignore[import-untyped]  # noqa: F401 - to know that it is there

    building = made_building(side)
    return Work(
        lambda _: _by_exact_distances(building),
        answer=lambda master: int((master < rebuilt(side)).sum()),  # the nearest costs most
    )


def _by_exact_distances(building: Building) -> Grid:
    doors = costs.drawn(building.geometry, building.doors)
    below = np.where(doors != NO_INFORMATION, doors, building.costs)
    return distance_peer.inflated(below, resolution=building.geometry.resolution, **INFLATION)


def _differing_anew(side: int) -> str:
    """Return in how many cells scipy's master is not noetic's; nothing if that is not known."""
    try:
        exact = _by_exact_distances(made_building(side))
    except ModuleNotFoundError:
        return ""
    return f": {int((exact != rebuilt(side)).sum()):,} cells differ"


BURST = 20
REACH = ceil(RADIUS_M / RESOLUTION_M)

Change = tuple[int, DoorLine]
"""A door, and what it draws from now on."""


def change_case(side: int, rounds: int | None) -> Case:
    """Return: from a door's change to the master.

    Args:
        side: Cells along each edge of the large map.
        rounds: Rounds that count; None: `ROUNDS`.
    """
    peers = (
        Peer(f"{OURS}, {named(PART)}", partial(_ours, PART), 0),
        Peer(f"{OURS}, {named(side)}", partial(_ours, side), 0, promise="< 2x"),
        Peer(f"{OURS}, seen before", partial(_ours_again, side), 0),
        Peer(f"plain Python, {named(PART)}", partial(_plain, PART), 0),
    )
    title = f"A door's change: {_touched(PART)} cells"
    return Case("costmap", title, "ms", peers, rounds or ROUNDS, BURST,
                tail_promise="", memory_promise=False)  # fmt: skip


def _changes(building: Building) -> Iterator[Change]:
    """Yield a change of each door in turn, for ever: from closed to open, from all else closed."""
    now = dict(building.doors)
    for door in cycle(building.doors):
        cost = FREE_SPACE if now[door].cost == LETHAL else LETHAL
        now[door] = replace(now[door], cost=cost)
        yield door, now[door]


def _touched(side: int) -> int:
    """Return in how many cells of the master a change of a door is looked for."""
    building = made_building(side)
    costmap = Costmap(building, building.doors)
    return _apply(costmap, next(_changes(building)))


def _apply(costmap: Costmap, change: Change) -> int:
    door, line = change
    costmap.doors.update({door: line})
    return sum(window.area for window in costmap.master.update())


def _ours(side: int) -> Work:
    """Return changes, none of which the costmap has seen before."""
    building = made_building(side)
    costmap = Costmap(building, building.doors)
    now = dict(building.doors)

    def changes() -> Iterator[Change]:
        nonlocal costmap
        while True:
            for door, line in islice(_changes(building), len(building.doors)):
                now[door] = line
                yield door, line
            now.update(building.doors)
            costmap = Costmap(building, building.doors)  # one that remembers nothing

    return Work(
        lambda change: _apply(costmap, change),
        changes(),
        lambda _: _differing(building, now, costmap.master.costs),
    )


def _ours_again(side: int) -> Work:
    """Return changes of a few doors that open and close again and again, as doors do."""
    building = made_building(side)
    few = dict(list(building.doors.items())[:BURST])
    costmap, now = Costmap(building, building.doors), dict(building.doors)
    endless = _changes(replace(building, doors=few))
    for change in islice(endless, 4 * len(few)):
        _apply(costmap, change)

    def changes() -> Iterator[Change]:
        for door, line in endless:
            now[door] = line
            yield door, line

    return Work(
        lambda change: _apply(costmap, change),
        changes(),
        lambda _: _differing(building, now, costmap.master.costs),
    )


def _plain(side: int) -> Work:
    """Return the same as noetic does it: what inflation reaches from a door is drawn anew."""
    building = made_building(side)
    now, master = dict(building.doors), plainly_drawn(building, building.doors).copy()

    def once(change: Change) -> None:
        door, line = change
        now[door] = line
        x0, y0, x1, y1 = plain_costmap.corners_of(building.geometry, line)
        window = CellWindow(x0, y0, x1 + 1, y1 + 1).dilated(REACH).within(building.geometry.whole)
        seen = window.dilated(REACH).within(building.geometry.whole)
        below = building.costs[seen.slices].copy()
        plain_costmap.draw_in(below, now.values(), building.geometry, seen)
        drawn = plain_costmap.inflated(below, resolution=building.geometry.resolution, **INFLATION)
        master[window.slices] = drawn[window.seen_from(seen).slices]

    return Work(once, _changes(building), lambda _: _differing(building, now, master))


def _differing(building: Building, doors: dict[int, DoorLine], master: Grid) -> int:
    """Return in how many cells a master is not what is drawn of these doors from nothing.

    A large one is drawn by us, which another case checks: loops take too long.
    """
    is_small = building.geometry.width <= PART
    anew = plainly_drawn(building, doors) if is_small else Costmap(building, doors).master.costs
    return int((anew != master).sum())
