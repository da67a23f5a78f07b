"""Where a proposed door's leaf hangs: only where visits saw it, and agree."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np
import pytest

from semmap_log.analysis.scans.proposing.proposals import _from_hinge, hinge_of
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState

LINE = np.array([1.0, 2.0, 0.0, 0.9])


def _visit(*, at_end: bool = False, degrees: float = 80.0) -> Visit:
    """Return a visit that saw a leaf at one end."""
    x, way = (1.9, -1) if at_end else (1.0, 1)
    turn = radians(degrees)
    leaf = (x, 2.0, x + way * 0.9 * cos(turn), 2.0 + 0.9 * sin(turn))
    return Visit(
        door_id=DoorId(1), first_ns=0, last_ns=1, scans=9, state=DoorState.OPEN, accuracy=0.99,
        opening=1.0, ajar=0.0, looks=20.0, through=9.0, stopped=0.0, behind_m=0.0, leaves=(leaf,),
    )  # fmt: skip


@pytest.mark.parametrize(("at_end", "said"), [(False, "start"), (True, "end")])
def test_it_hangs_where_leaves_were_seen(at_end: bool, said: str) -> None:
    assert hinge_of(LINE, [_visit(at_end=at_end)] * 2) == said


@pytest.mark.parametrize(
    "visits",
    [
        [],
        [_visit()],
        [_visit(), _visit(at_end=True)],
        [_visit(degrees=12)] * 3,
        [replace(_visit(), looks=1.0)] * 3,
        [replace(_visit(), passed=True)] * 3,
        [replace(_visit(), leaves=_visit().leaves + _visit(at_end=True).leaves)] * 3,
    ],
)
def test_otherwise_nobody_knows(visits: list[Visit]) -> None:
    """One visit alone, two that disagree, a leaf that is nearly shut, a glance, two leaves."""
    assert hinge_of(LINE, visits) == ""


def test_in_a_wide_opening_it_could_be_one_of_two() -> None:
    assert hinge_of(np.array([1.0, 2.0, 0.0, 1.6]), [_visit()] * 3) == ""


def test_a_proposed_line_is_turned_to_start_at_its_hinge() -> None:
    """As a door's line does."""
    assert _from_hinge(LINE, "end") == pytest.approx([1.9, 2.0, pi, 0.9])
    assert _from_hinge(LINE, "start") is LINE
    assert _from_hinge(LINE, "") is LINE
