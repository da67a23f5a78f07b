"""What visits tell of a door that should be looked at."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.analysis.scans.door_figures import Concern, Mean, door_figures, door_warnings
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState
from tests.analysis.scans.some_visits import some_visit

CLOSED, UNKNOWN = DoorState.CLOSED, DoorState.UNKNOWN


def _texts(visits: Sequence[Visit], **how: frozenset[DoorId]) -> list[str]:
    return [
        warning.about(str(warning.door_id))
        for warning in door_warnings(door_figures(visits), **how)
    ]


@pytest.mark.parametrize(
    ("seen", "offset"),
    [
        ([(0, at) for at in (0.20, 0.24, 0.22, 0.22, nan)], "0.22 m behind"),
        ([(0, -0.2)] * 3, "0.20 m before"),
        ([(1, 0.2), (1, 0.22), (-1, -0.2), (-1, -0.18)], "0.20 m to the right of"),
        ([(1, 0.2), (-1, 0.2)] * 2, "0.20 m behind"),
        ([(0, 0.3)] * 2, ""),
        ([(0, 0.08)] * 20, ""),
        ([(0, at) for at in (0.6, -0.4, 0.5, -0.2, 0.3)], ""),
    ],
    ids=["behind", "before", "drawn beside", "behind a pane", "too few", "a recess", "by chance"],
)
def test_an_offset_of_a_line_is_told_with_its_side(
    seen: list[tuple[int, float]], offset: str
) -> None:
    """From both sides of a line that is drawn beside its leaf, what holds is left or right."""
    texts = _texts([
        some_visit(7, n, state=CLOSED, side=side, behind_m=at) for n, (side, at) in enumerate(seen)
    ])  # fmt: skip

    assert len(texts) == bool(offset)
    assert offset in "".join(texts)


def test_visits_that_met_a_leaf_tell_where_it_is() -> None:
    """A grazing visit does not, nor one whose beams mostly go on, nor one of an open door."""
    told = [some_visit(7, n, state=CLOSED, behind_m=0.14) for n in range(3)]
    toward = [some_visit(7, n, state=CLOSED, behind_m=-0.3, near=40.0) for n in range(20)]
    ajar = [some_visit(7, n, state=CLOSED, behind_m=0.3, ajar=0.6) for n in range(20)]
    grazing = [some_visit(7, n, state=CLOSED, behind_m=0.3, looks=1.9, near=1.9) for n in range(20)]
    beyond = [some_visit(7, n, state=CLOSED, behind_m=0.3, looks=9.0) for n in range(20)]
    wide = [some_visit(7, n, behind_m=0.3, passed=n == 0) for n in range(20)]

    assert "0.14 m behind" in _texts(told)[0]
    assert not _texts(told[:2])
    assert not _texts(ajar)
    assert not _texts(toward)
    assert not _texts(grazing)
    assert not _texts(beyond)
    assert not _texts(wide)


def test_an_open_door_that_nobody_drives_through_may_be_glass() -> None:
    """A laser sees through a pane; one that is known to be glass needs no question."""
    visits = [some_visit(3, n) for n in range(5)]

    (text,) = _texts(visits)

    assert text.startswith("door 3: always open (5 visits), never driven through: glass?")
    assert not _texts(visits, glass=frozenset({DoorId(3)}))
    assert not _texts(visits[:4])
    assert not _texts([*visits, some_visit(3, 9, passed=True)])
    assert not _texts([*visits, some_visit(3, 9, state=CLOSED)])


def test_a_door_that_stays_undecided() -> None:
    """More than half of its visits, with the commonest reason."""
    whys = ["no beam went through", "ajar", "no beam went through"]
    visits = [some_visit(3, n, state=UNKNOWN, why=why) for n, why in enumerate(whys)]
    decided = [some_visit(3, n, state=CLOSED) for n in (4, 5)]

    assert _texts([*visits, *decided]) == [
        "door 3: 3 of 5 visits undecided, mostly: no beam went through"
    ]
    assert not _texts([*visits, *decided, some_visit(3, 6)])


def test_a_closed_door_that_was_driven_through() -> None:
    """Both at the same time cannot be; one after the other can."""
    passing = some_visit(3, 100, passed=True)

    visits = [some_visit(3, 98, state=CLOSED), passing]
    told = door_warnings(door_figures(visits))

    assert [warning.concern for warning in told] == [Concern.contradiction]
    assert "(1 visit)" in told[0].text
    assert _texts([some_visit(3, 101, state=CLOSED), passing]) == _texts(visits)
    assert not _texts([some_visit(3, 90, state=CLOSED), passing])


def test_figures_are_those_of_each_door() -> None:
    """Undecided visits say no accuracy; what was not seen has no part in a mean."""
    first, second = door_figures([
        some_visit(9, 0, accuracy=0.9, opening=nan),
        some_visit(2, 1, state=CLOSED, accuracy=0.8, opening=0.1, behind_m=0.1, side=1),
        some_visit(2, 2, state=UNKNOWN, accuracy=0.5, opening=0.4, why="ajar"),
        some_visit(2, 3, accuracy=1.0, opening=1.0, passed=True),
    ])  # fmt: skip

    assert (first.door_id, first.visits, first.open, first.closed) == (2, 3, 0, 1)
    assert (first.undecided, first.passed, first.decided, first.why) == (1, 1, 2, "ajar")
    assert (first.accuracy.value, first.opening.value) == (0.8, pytest.approx(0.25))
    assert (first.behind_m.value, first.left_m.value) == (0.1, -0.1)
    assert (second.door_id, second.accuracy.value) == (9, 0.9)
    assert isnan(second.opening.value)
    assert isnan(second.left_m.value)


@given(st.permutations([some_visit(n % 3, n, state=DoorState(n % 3), behind_m=0.2, side=n % 2)
                        for n in range(12)]))  # fmt: skip
def test_the_order_of_visits_is_no_matter(visits: list[Visit]) -> None:
    """Warnings are about what was seen, not about how it is listed."""
    ordered = sorted(visits, key=lambda visit: visit.first_ns)

    assert door_warnings(door_figures(visits)) == door_warnings(door_figures(ordered))


@given(st.lists(st.floats(-100, 100), min_size=2))
def test_a_mean_and_its_error(values: list[float]) -> None:
    """As of all numbers at once; NaN is none of them."""
    mean = Mean()
    for value in [*values, nan]:
        mean.add(value)

    assert mean.count == len(values)
    assert mean.value == pytest.approx(np.mean(values), abs=1e-9)
    assert mean.error == pytest.approx(np.std(values, ddof=1) / len(values) ** 0.5, abs=1e-6)
