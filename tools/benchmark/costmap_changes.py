"""Case: one door opens or closes, in a small map and in a large one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import cycle, islice
from math import ceil

from benchmark import plain_costmap
from benchmark.case import Case, Peer, Work
from benchmark.costmaps import (
    INFLATION,
    PART,
    RADIUS_M,
    ROUNDS,
    Costmap,
    Grid,
    named,
    plainly_drawn,
)
from benchmark.made_building import RESOLUTION_M, Building, made_building
from benchmark.peers import OURS
from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, LETHAL
from semmap_log.analysis.costmap_2d.door_layer import DoorLine
from semmap_log.analysis.costmap_2d.grid import CellWindow

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
