"""Cases: a large costmap drawn anew; and the costmap that the other cases draw, too."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmark import distance_peer, plain_costmap
from benchmark.case import Case, Peer, Work
from benchmark.made_building import Building, made_building
from benchmark.peers import OURS
from semmap_log.analysis.costmap_2d import door_layer
from semmap_log.analysis.costmap_2d.costs import NO_INFORMATION
from semmap_log.analysis.costmap_2d.door_layer import DoorLayer, DoorLine
from semmap_log.analysis.costmap_2d.inflation import InflationLayer
from semmap_log.analysis.costmap_2d.layered import LayeredCostmap
from semmap_log.analysis.costmap_2d.static_layer import StaticLayer

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
        Peer(OURS, partial(_ours, side), checksum(plainly_drawn(building, building.doors))),
        Peer(f"plain Python{part}", partial(_plain, PART), checksum(rebuilt(PART)), units=share),
        Peer(f"scipy{_differing(side)}", partial(_scipy, side), 0),
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


def _ours(side: int) -> Work:
    made_building(side)
    return Work(lambda _: rebuilt(side), answer=checksum)


def _plain(side: int) -> Work:
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
    doors = door_layer.drawn(building.geometry, building.doors)
    below = np.where(doors != NO_INFORMATION, doors, building.costs)
    return distance_peer.inflated(below, resolution=building.geometry.resolution, **INFLATION)


def _differing(side: int) -> str:
    """Return in how many cells scipy's master is not noetic's; nothing if that is not known."""
    try:
        exact = _by_exact_distances(made_building(side))
    except ModuleNotFoundError:
        return ""
    return f": {int((exact != rebuilt(side)).sum()):,} cells differ"
