"""What is believed of a door from what was seen of it: now, later, and after an outage."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.belief_fold import Beliefs, by_name
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.filter import DoorFilter
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.chains import stretches_of
from tests.analysis.probabilities.known import evidence, hours_ns
from tests.analysis.probabilities.telling import DOOR, Told, added, ns_of, put, seen, told_of

UTC = LocalClock("UTC")
H, D = 3600.0, 86_400.0


def believed(*told: Told, at_s: float | list[float], name: str = "filter") -> Forecast:
    """Return what is believed at some times, with what was told by then."""
    beliefs = Beliefs(by_name(name), UTC, told_of(*told))
    return beliefs.predict(DOOR, np.array([ns_of(second) for second in np.atleast_1d(at_s)]))


def at_rounds(is_open: np.ndarray, *, from_s: float = 0.0, every_s: float = 1800.0) -> list[Told]:
    """Return a robot's sightings, right nine times in ten by its own word and here always."""
    return [
        seen("open" if opened else "closed", from_s + every_s * i)
        for i, opened in enumerate(is_open.tolist())
    ]


def test_looking_on_and_on_does_not_wear_a_belief_out() -> None:
    """Saying the same ten times a second for a minute weakens nothing, certain or not."""
    noisy = [seen("closed", H + 0.1 * i) for i in range(600)]
    certain = [seen("closed", 2 * H, 1.0) for _ in range(30)]

    found = believed(added(), *noisy, *certain, at_s=[H, H + 59.9, 2 * H])

    np.testing.assert_allclose(found.p_open, [0.1, 0.1, 0.001], atol=0.005)
    assert np.isfinite(found.low).all()


@pytest.mark.parametrize(("state", "expected"), [("open", 0.999), ("closed", 0.001)])
def test_a_state_that_was_set_is_certain_now(state: str, expected: float) -> None:
    """An update is an observation of accuracy 1, whatever was seen before."""
    other = at_rounds(np.full(20, state == "closed"))

    found = believed(added(), *other, put(state, 10 * H), at_s=10 * H)

    assert expected == pytest.approx(found.p_open[0])


@pytest.mark.parametrize("state", [True, False])
def test_far_ahead_it_is_the_schedule(state: bool) -> None:
    """What is left of now falls with every hour, and after a week is none."""
    rng = np.random.default_rng(5)
    told = [*stretches_of(24 * 60 - 2, 6.0, 3.0, rng)]
    told = evidence([*told, (24 * 60 - 2.0, 24 * 60.0, state)]).up_to(int(hours_ns(24 * 60)))
    ahead = np.array([0.0, 0.5, 1.0, 3.0, 8.0, 24.0, 168.0])
    times_ns, known_ns = hours_ns(24 * 60 + ahead), hours_ns(np.full(7, 24 * 60.0))
    schedule = DoorSchedule(told, UTC).p_open(times_ns, known_ns)

    found = DoorFilter(told, UTC).predict(times_ns, known_ns)

    left = (found.p_open - schedule) * (1 if state else -1)
    assert left[0] > 0.2
    assert (np.diff(left[:4]) < 0).all()
    assert left[:4].min() > 0
    np.testing.assert_allclose(left[5:], 0, atol=0.02)


def test_a_door_that_is_as_ever_is_expected_to_be_as_ever() -> None:
    """Open from eight on each day, and seen open at nine: that is no news for the evening."""
    days = [put(state, day * D + hour * H)
            for day in range(28) for state, hour in (("closed", 18.0), ("open", 32.0))]  # fmt: skip
    usual, unusual = 30 * D + 9 * H, 29 * D + 20 * H
    told = told_of(added(), *days, put("unknown", 28 * D + 20 * H), seen("open", unusual),
                   seen("open", usual))  # fmt: skip
    asked, known = ([ns_of(second) for second in seconds] for seconds in (
        (30 * D + 21 * H, 29 * D + 21 * H), (usual, unusual)))  # fmt: skip

    by_filter, by_schedule = (
        Beliefs(by_name(name), UTC, told).predict(DOOR, np.array(asked), np.array(known)).p_open
        for name in ("filter", "schedule")
    )

    assert by_schedule.max() < 0.3
    assert by_filter[0] - by_schedule[0] < 0.02
    assert by_filter[1] - by_schedule[1] > 0.05


def test_an_outage_is_not_as_before() -> None:
    """Open when the contact failed: an hour later less surely, a week later as on any such day."""
    days = [put(state, day * D + hour * H)
            for day in range(28) for state, hour in (("closed", 0.0), ("open", 20.0))]  # fmt: skip
    failed = 28 * D

    told = [added(), *days, put("unknown", failed), put("unknown", 36 * D)]

    found = believed(*told, at_s=[failed - 1, failed + H, failed + 7 * D + 12 * H])

    assert 0.999 == pytest.approx(found.p_open[0])
    assert 0.2 < found.p_open[1] < 0.99
    assert found.p_open[2] < 0.2
    assert found.high[1] - found.low[1] > found.high[0] - found.low[0]


def test_what_was_seen_grows_old() -> None:
    """A door seen once is known for as long as half of that is left, and then UNKNOWN."""
    told = [added(), seen("open", H), put("unknown", 3 * D)]

    found = believed(*told, at_s=[H - 1, H, H + 600, 2 * D])

    assert [False, True, True, False] == found.is_known.tolist()
    assert found.p_open[1] > found.p_open[2] > found.p_open[3]


def test_how_long_doors_stay_open_matters_not_only_how_often() -> None:
    """Of a door that changes by the hour little is left after two hours."""
    end = 24.0 * 60
    now_ns, requested_ns = hours_ns([end]), hours_ns([end + 2.0])
    found = {}
    for mean_h in (1.0, 24.0):
        rng = np.random.default_rng(11)
        told = stretches_of(end - 0.5, mean_h, mean_h, rng)
        filtered = DoorFilter(evidence([*told, (end - 0.5, end, True)]).up_to(now_ns[0]), UTC)
        found[mean_h] = float(filtered.predict(requested_ns, now_ns).p_open[0])

    assert found[1.0] < 0.75
    assert found[24.0] > 0.85


def test_a_door_that_was_just_seen_does_not_lean_on_hours_nobody_knows() -> None:
    """Rounds by day for four days."""
    rounds = np.arange(0, 24 * 5 - 2, 0.5)
    by_day = rounds[(rounds % 24 >= 8) & ((rounds % 24 < 18) | (rounds >= 24 * 4 + 8))]
    told = [seen("open" if h % 24 < 10 else "closed", h * H) for h in by_day.tolist()]
    last_s = float(by_day[-1]) * H

    found = believed(added(), *told, at_s=[last_s + 60, last_s + 4 * H])

    assert found.p_open[0] < 0.02
    assert found.high[0] < 0.1
    assert found.high[1] > 0.3
