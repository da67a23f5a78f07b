"""When a sighting of a door no longer holds, against a count minute by minute."""

from __future__ import annotations

import statistics
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.timeline import (
    USUAL_GAP_NS,
    Hold,
    Timeline,
    hold_of,
    time_shares,
    timeline,
)
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorUpdated,
    Event,
    SightingsThinned,
)
from tests.batches import batch_of
from tests.conftest import SteadyClock

MINUTE_NS = 60 * 10**9
HOUR_NS = 60 * MINUTE_NS
DOOR = DoorId(1)
END = 400
"""Minutes that each example takes."""
UNKNOWN, OPEN, CLOSED = DoorState.UNKNOWN, DoorState.OPEN, DoorState.CLOSED
RECORDINGS = Path(__file__).parents[3] / "recordings"


class Report(NamedTuple):
    """What was said of the door at a minute."""

    minute: int
    state: DoorState
    is_sighting: bool

    def event(self) -> Event:
        at = {"door_id": DOOR, "happened_ns": self.minute * MINUTE_NS}
        if not self.is_sighting:
            return DoorUpdated(changed=Changed.STATE, state=self.state, **at)
        if self.state is OPEN and self.minute % 4:
            return DoorPassed(passed=True, **at)
        return DoorObserved(state=self.state, **at)


reports = st.lists(
    st.builds(
        Report,
        # Even minutes: so that the mean of two gaps, too, is of whole minutes.
        st.integers(1, END // 2 - 1).map(lambda half: 2 * half),
        st.sampled_from([UNKNOWN, OPEN, OPEN, CLOSED, CLOSED]),
        st.sampled_from([True, True, True, False]),
    ),
    max_size=25,
)


def told(said: list[Report], holds: int) -> Timeline:
    added = DoorAdded(door_id=DOOR, state=CLOSED, happened_ns=0)
    events = [added, *(report.event() for report in said)]
    return timeline([of(events)], DOOR, end_ns=END * MINUTE_NS, holds=holds)


def of(events: list[Event]) -> EventBatch:
    """Return events as columns, recorded after all of them had happened."""
    return batch_of(events, recorded_ns=range(10 * HOUR_NS, 10 * HOUR_NS + len(events)))


def by_the_minute(said: list[Report], holds: int) -> list[tuple[DoorState, bool]]:
    """Return of each minute the state, and whether the door was seen in it or set so."""
    looks = sorted({report.minute for report in said if report.is_sighting})
    gaps = [later - earlier for earlier, later in pairwise(looks)]
    hold = holds * (statistics.median(gaps) if len(gaps) >= 2 else 60)
    found = []
    for minute in range(END):
        last = Report(0, CLOSED, is_sighting=False)
        for report in said:
            if last.minute <= report.minute <= minute:
                last = report
        lapses = last.is_sighting and last.state is not UNKNOWN and holds > 0
        found.append((last.state, not lapses or minute < last.minute + hold))
    return found


@given(reports, st.integers(0, 3))
def test_each_minute_counts_as_seen_or_not_seen(said: list[Report], holds: int) -> None:
    """Sightings hold for some median gaps, what was set until the next report."""
    found, expected = told(said, holds), by_the_minute(said, holds)

    edges = np.arange(END + 1) * MINUTE_NS
    for state in (OPEN, CLOSED):
        seen = [MINUTE_NS * (one == (state, True)) for one in expected]
        lapsed = [MINUTE_NS * (one == (state, False)) for one in expected]
        assert seen == found.spent_ns(state, edges).tolist()
        assert lapsed == found.lapsed_ns(state, edges).tolist()
        assert sum(seen) == found.total_ns(state)
    shares = time_shares(found, edges)
    assert [float(one[1] and one[0] is not UNKNOWN) for one in expected] == shares.known.tolist()
    assert [1.0] * END == shares.there.tolist()
    for interval in found:
        minutes = range(interval.start_ns // MINUTE_NS, interval.end_ns // MINUTE_NS)
        assert interval.seen_ns == MINUTE_NS * sum(expected[minute][1] for minute in minutes)


@given(reports, st.integers(0, END), st.integers(0, END))
def test_a_part_is_cut_out_of_the_whole(said: list[Report], one: int, other: int) -> None:
    """How long a sighting holds does not depend on the part that is asked for."""
    since, until = min(one, other), max(one, other)
    whole, expected = told(said, 2), by_the_minute(said, 2)

    part = whole.between(since * MINUTE_NS, until * MINUTE_NS)

    assert whole.hold == part.hold
    for state in (OPEN, CLOSED):
        seen = sum(expected[minute] == (state, True) for minute in range(since, until))
        assert seen * MINUTE_NS == part.total_ns(state)


@given(reports)
def test_lapses_are_no_changes(said: list[Report]) -> None:
    """States, beginnings, events and counts are those of a log in which all holds."""
    plain, found = told(said, 0), told(said, 1)

    for name in ("start_ns", "end_ns", "state", "event", "sightings"):
        assert getattr(plain, name).tolist() == getattr(found, name).tolist()
    assert plain.hold is None
    assert not len(plain.lapse_start_ns)


@pytest.mark.parametrize(
    ("seconds", "gap_ns", "looks"),
    [
        ([], USUAL_GAP_NS, 0),
        ([0, 600], USUAL_GAP_NS, 2),
        ([0, 600, 1200], 600 * 10**9, 3),
        ([0, 30, 59, 600, 630, 4200], 2100 * 10**9, 3),  # a robot that looks for a while
        (list(range(0, 3600, 10)), 310 * 10**9, 12),  # a sensor that never stops
    ],
)
def test_a_look_is_a_pass(seconds: list[int], gap_ns: int, looks: int) -> None:
    """Sightings less than a minute apart are one look, for five minutes at most."""
    found = hold_of(np.array(seconds, np.int64) * 10**9, 3)

    assert Hold(3, gap_ns, looks) == found
    assert 3 * gap_ns == found.ns


def test_what_was_thinned_out_still_counts_as_looks() -> None:
    """Of a door that was seen each ten minutes the first and the last sighting of an hour stay."""
    seen_ns = [(60 * hour + ten) * MINUTE_NS for hour in range(4) for ten in range(0, 60, 10)]
    added = DoorAdded(door_id=DOOR, state=CLOSED, happened_ns=0)
    sightings = [DoorObserved(door_id=DOOR, state=CLOSED, happened_ns=ns) for ns in seen_ns]
    kept = [one for place, one in enumerate(sightings) if place % 6 in (0, 5)]
    gone = [
        SightingsThinned(
            door_id=DOOR, state=CLOSED, count=4, first_ns=first, last_ns=first + 30 * MINUTE_NS,
            happened_ns=first + 30 * MINUTE_NS, first_event=10**6 + first,
        )
        for first in seen_ns[1::6]
    ]  # fmt: skip

    full, thinned = (
        timeline([of([added, *some])], DOOR, end_ns=10 * HOUR_NS, holds=3)
        for some in (sightings, kept + gone)
    )

    assert full.hold == thinned.hold
    assert full.lapse_start_ns.tolist() == thinned.lapse_start_ns.tolist()
    assert [seen_ns[-1] + 30 * MINUTE_NS] == thinned.lapse_start_ns.tolist()


def test_friday_evening_does_not_make_sunday_known(tmp_path: Path, clock: SteadyClock) -> None:
    """Open in one look of ten, the last one on Friday: not over the weekend."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door(at="2026-02-23T08:00")
        for day in range(23, 28):
            for hour in range(8, 18):
                log.observe(
                    door, "open" if hour == 17 else "closed", at=f"2026-02-{day}T{hour:02}:00"
                )
        log.annotate(door, "note", "on Sunday")
    log = sl.read(tmp_path / "log")

    found = log.timeline(door, until="2026-03-02")

    opened, closed = found.total_ns(OPEN), found.total_ns(CLOSED)
    whole = int(found.duration_ns.sum())
    assert Hold(3, HOUR_NS, 50) == found.hold
    assert 5 * 3 * HOUR_NS == opened
    assert opened + closed < 0.5 * whole
    assert found.not_seen_since_ns == log.instant("2026-02-27T20:00")


@pytest.mark.slow
def test_a_robots_week_is_seen_as_far_as_it_looked() -> None:
    """A lapse begins three median gaps after the last sighting."""
    log = sl.read(RECORDINGS / "clinic_week")
    seen_ns: dict[int, list[int]] = {}
    for entry in log.history(kinds=[DoorObserved, DoorPassed]):
        if not entry.retracted and getattr(entry.event, "passed", True):
            seen_ns.setdefault(int(entry.door_id or 0), []).append(entry.folds_ns)

    found = log.timelines()

    for door_id, one in found.items():
        assert one.hold is not None
        times = sorted(seen_ns.get(int(door_id), []))
        for start_ns in one.lapse_start_ns.tolist():
            assert start_ns - one.hold.ns in times
            assert not any(start_ns - one.hold.ns < ns < start_ns for ns in times)
    lapsed = sum(int(one.not_seen_ns.sum()) for one in found.values())
    assert 0 < lapsed < 0.2 * sum(int(one.duration_ns.sum()) for one in found.values())
