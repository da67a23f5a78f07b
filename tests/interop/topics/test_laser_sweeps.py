"""LaserScan messages as drivers send them, and as none should."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from semmap_log.interop.topics.lasers.placing import MOST_BEAMS, Sweep, Unusable, sweep_of
from tests.interop.topics.laser_room import LaserRoom

ROOM = LaserRoom()


def _scan(**values: Any) -> Sweep | Unusable:
    return sweep_of(ROOM.scan(1.0, **values))


def _ranges(*values: float) -> Any:
    ranges = np.full(ROOM.beams, 2.0, np.float32)
    ranges[: len(values)] = values
    return ranges


def test_a_scan_has_the_angles_and_times_of_its_beams() -> None:
    """The first at angle_min and the stamp, each further one an increment on."""
    found = _scan()

    assert isinstance(found, Sweep)
    assert ("laser", ROOM.ns(1.0), 12.0) == (found.frame, found.stamp_ns, found.max_range)
    np.testing.assert_allclose(np.radians([-180, -179, 0]), found.angles[[0, 1, 180]], atol=1e-6)
    assert [0, 50_000_000] == pytest.approx(found.after_ns[[0, 180]].tolist(), abs=10)


def test_drivers_words_for_no_return_are_one() -> None:
    """Infinity, 0 and beyond the laser's range: lost."""
    lost, nothing = (math.inf, 0.0, 12.01, 81.91), (math.nan, -math.inf, -1.0, 0.04)

    found = _scan(ranges=_ranges(*lost, *nothing, 0.06, 12.0))

    assert isinstance(found, Sweep)
    assert [True] * 4 + [False] * 6 == np.isposinf(found.ranges[:10]).tolist()
    assert [False] * 4 + [True] * 4 + [False] * 2 == np.isnan(found.ranges[:10]).tolist()


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_laser_may_turn_either_way(clockwise: bool) -> None:
    """With angle_increment below 0 its angles fall."""
    step = math.tau / ROOM.beams
    if clockwise:
        found = _scan(angle_min=3.0, angle_increment=-step, angle_max=3.0 - step * (ROOM.beams - 1))
    else:
        found = _scan()

    assert isinstance(found, Sweep)
    assert (np.diff(found.angles) < 0).all() == clockwise


_STEP = math.tau / ROOM.beams


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ({"ranges": np.zeros(0, np.float32)}, "without beams"),
        ({"ranges": np.ones(1, np.float32)}, "without beams"),
        ({"angle_increment": 0.0}, "angle_increment cannot be"),
        ({"angle_increment": math.pi}, "angle_increment cannot be"),
        ({"angle_increment": math.nan}, "not finite"),
        ({"angle_min": math.inf}, "not finite"),
        ({"angle_max": math.nan}, "not finite"),
        ({"time_increment": math.inf}, "not finite"),
        ({"ranges": np.ones(180, np.float32)}, "ranges and angles disagree"),
        ({"angle_max": 0.0}, "ranges and angles disagree"),
        ({"angle_increment": -_STEP}, "ranges and angles disagree"),
        ({"ranges": np.ones(722, np.float32), "angle_max": -math.pi + 721 * _STEP}, "whole turn"),
        ({"time_increment": 0.01}, "takes more than 1 s"),
        ({"time_increment": -0.01}, "takes more than 1 s"),
        ({"range_max": 0.0}, "range_max"),
        ({"range_max": math.nan}, "range_max"),
    ],
)
def test_a_scan_that_cannot_be_is_refused_by_what_is_wrong(
    values: dict[str, Any], kind: str
) -> None:
    """Never by an exception, nor by beams that point anywhere."""
    found = _scan(**values)

    assert isinstance(found, Unusable)
    assert kind in found.kind


def test_an_end_that_is_counted_otherwise_is_no_disagreement() -> None:
    """Some drivers call angle_max the end of the turn, not the last beam."""
    assert isinstance(_scan(angle_max=math.pi), Sweep)


def test_of_a_million_beams_some_thousand_are_taken() -> None:
    """Evenly: each at its own angle."""
    step = math.tau / 1_000_000
    ranges = np.arange(1_000_000, dtype=np.float32) / 1e5

    found = _scan(
        ranges=ranges, angle_increment=step, angle_max=-math.pi + 999_999 * step,
        time_increment=1e-7,
    )  # fmt: skip

    assert isinstance(found, Sweep)
    assert MOST_BEAMS // 2 < len(found.ranges) <= MOST_BEAMS
    far = np.isfinite(found.ranges)
    assert 4000 < far.sum()
    np.testing.assert_allclose(
        (found.angles[far] + math.pi) / math.tau * 10, found.ranges[far], atol=1e-3
    )


def test_a_laser_without_an_end_has_one_here() -> None:
    """A simulator's range_max is infinity."""
    found = _scan(range_max=math.inf, ranges=_ranges(math.inf, 50.0))

    assert isinstance(found, Sweep)
    assert 100.0 == found.max_range
    assert [math.inf, 50.0] == found.ranges[:2].tolist()
