"""A visit tells from which side a door was seen, and where a leaf is that is drawn elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.scans.door_figures import Concern, door_figures, door_warnings
from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import DoorPlaces, PlacedScan, Visit
from semmap_log.core.model.doors import DoorState
from tests.analysis.scans.some_scans import LINE, SHUT, some_scan
from tests.analysis.scans.some_visits import START_NS, S

DOWN, UP = 0.0, 2.0
"""y of the laser: to the right of the door's line, and to its left."""


def _drive(y: float, begins_s: float = 0.0) -> list[PlacedScan]:
    """Past the shut door, along a line."""
    return [
        some_scan(START_NS + round((begins_s + n / 5) * S), 1.0 + n / 8, y, leaf=SHUT, beams=720)
        for n in range(25)
    ]


def _visits(scans: list[PlacedScan], across: float = 0.0) -> list[Visit]:
    """What is seen of the door if it is drawn so far to the left of where it is."""
    x, y, theta, width = LINE
    doors = DoorPlaces(
        np.array([1]), np.array([0]), np.array([[x, y + across, theta, width]]), ("",),
        np.array([False]),
    )  # fmt: skip
    watcher = DoorWatcher()
    return [*watcher.take(scans, doors), *watcher.close()]


@pytest.mark.parametrize(("y", "side"), [(DOWN, -1), (UP, 1)])
def test_a_door_is_seen_from_where_the_laser_was(y: float, side: int) -> None:
    """The left of its line, or the right."""
    (visit,) = _visits(_drive(y))

    assert (visit.side, visit.state) == (side, DoorState.CLOSED)
    assert visit.near == pytest.approx(visit.looks)
    assert visit.behind_m == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("across", [0.14, -0.14])
def test_a_line_that_is_drawn_beside_the_leaf_is_told_with_its_side(across: float) -> None:
    """Seen from both, it is behind once and before once: what holds is left or right."""
    visits = _visits([*_drive(DOWN), *_drive(UP, 60.0), *_drive(DOWN, 120.0)], across)

    (warning,) = door_warnings(door_figures(visits))

    assert {visit.side for visit in visits} == {1, -1}
    assert warning.concern is Concern.offset
    side = "right" if across > 0 else "left"
    assert f"beams end 0.14 m to the {side} of its line on average" in warning.text
