"""A door's intervals against replays: at every moment, the same state."""

from __future__ import annotations

import random
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.timeline import Interval, Timeline, timeline
from semmap_log.core.messages import layout
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
    Retracted,
)
from semmap_log.errors import MomentError, UnknownDoorError
from tests.batches import batch_of
from tests.conftest import SteadyClock
from tests.core.folds.dictionary_model import Told, model
from tests.test_replay import random_log

DOOR = DoorId(1)
UNKNOWN, OPEN, CLOSED = DoorState.UNKNOWN, DoorState.OPEN, DoorState.CLOSED


def state_at(found: Timeline, ns: int) -> DoorState | None:
    """Return the state at a time; None: no interval holds."""
    holding = [
        interval
        for i, interval in enumerate(found)
        if interval.start_ns <= ns < interval.end_ns
        or (ns == interval.end_ns and i == len(found) - 1 and not found.removed)
    ]
    assert len(holding) <= 1
    return holding[0].state if holding else None


def sets(event: Event) -> DoorState | None:
    """Return the state that an event sets."""
    if isinstance(event, (DoorAdded, DoorObserved)):
        return event.state
    if isinstance(event, DoorUpdated) and event.changed & Changed.STATE:
        return event.state
    return OPEN if isinstance(event, DoorPassed) and event.passed else None


def moments(told: list[Told]) -> list[int]:
    """Return the times at which something can change, and those just before."""
    times = {t for _, happened, recorded, commit, _ in told for t in (happened, recorded, commit)}
    return sorted(times | {t - 1 for t in times})


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32))
def test_at_every_moment_the_interval_is_what_a_replay_says(seed: int) -> None:
    """Late events, equal stamps, retractions, doors that come and go."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        told = random_log(Path(folder) / "log", dice, commits=25)
        log = sl.read(Path(folder) / "log")
        times = moments(told)
        known_at = dice.choice([None, None, *times])
        end = dice.choice([None, *times])
        for door in sorted({e.door_id for *_, e in told if isinstance(e, DoorAdded)}):
            try:
                found = log.timeline(door, at=end, known_at=known_at)
            except UnknownDoorError:
                assert door not in model(told)
                continue
            for at in times:
                if end is not None and at > end:
                    break
                if len(found) and not found.removed and at > found.end_ns[-1]:
                    break

                replayed = model(told, at, known_at).get(door)

                expected = None if replayed is None else replayed["state"]
                assert expected == state_at(found, at), (door, at, list(found))
                if dice.random() < 0.05:
                    doors = log.replay(at=at, known_at=known_at).doors
                    assert expected == (doors[door].state if door in doors else None)


def said_by(found: Timeline) -> tuple[int, list[Interval], bool]:
    """
    All that a timeline says.
    """
    return found.door_id, list(found), found.removed


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32))
def test_all_doors_at_once_are_each_as_alone(seed: int) -> None:
    """One reading for all doors gives what a reading for each would, and of no door less."""
    with tempfile.TemporaryDirectory() as folder:
        told = random_log(Path(folder) / "log", random.Random(seed), commits=25)
        log = sl.read(Path(folder) / "log")
        added = sorted({e.door_id for *_, e in told if isinstance(e, DoorAdded)})

        together = log.timelines()
        some = log.timelines(added[::2])

        alone = {door: said_by(log.timeline(door)) for door in together}
        assert alone == {door: said_by(found) for door, found in together.items()}
        assert {i: said for i, said in alone.items() if i in added[::2]} == {
            i: said_by(found) for i, found in some.items()
        }
        visible = {e.door_id for *_, e in told if isinstance(e, DoorAdded)} & set(
            log.replay().doors
        )
        assert visible <= set(together)


stamps = st.integers(0, 6)
states = st.sampled_from([UNKNOWN, OPEN, CLOSED])
of_the_door = st.one_of(
    st.builds(DoorObserved, door_id=st.sampled_from([1, 2]), happened_ns=stamps, state=states),
    st.builds(DoorPassed, door_id=st.just(1), happened_ns=stamps, passed=st.booleans()),
    st.builds(
        DoorUpdated,
        door_id=st.just(1),
        happened_ns=stamps,
        changed=st.sampled_from([Changed.STATE, Changed.PROB_OPEN]),
        state=states,
    ),
)


@st.composite
def lives(draw: st.DrawFn) -> list[Told]:
    """A door's events in a few instants: the adding anywhere among them, a removal perhaps."""
    events: list[Event] = draw(st.lists(of_the_door, max_size=12))
    born = draw(st.integers(0, len(events)))
    events.insert(born, draw(st.builds(DoorAdded, door_id=st.just(1), happened_ns=stamps,
                                       state=states)))  # fmt: skip
    if draw(st.booleans()):
        dead = draw(st.integers(born + 1, len(events)))
        events.insert(dead, DoorRemoved(door_id=DOOR, happened_ns=draw(stamps)))
    recorded = draw(st.lists(stamps, min_size=len(events), max_size=len(events)))
    told = [
        (number, event.happened_ns or 0, then, then, event)
        for number, (event, then) in enumerate(zip(events, recorded, strict=True))
    ]
    ends = [min(h, r) for _, h, r, _, e in told if isinstance(e, (DoorAdded, DoorRemoved))]
    assume(ends == sorted(ends))  # a door that is removed before it is added is refused
    return told


def timeline_of(told: list[Told]) -> Timeline:
    """Return the timeline of what was told, each event in a batch of its own, the last first."""
    batches = [batch_of([e], first_number=n, recorded_ns=[r]) for n, _, r, _, e in told]
    return timeline(reversed(batches), DOOR)


@settings(deadline=None)
@given(lives())
def test_events_at_equal_times_count_in_the_order_of_their_numbers(told: list[Told]) -> None:
    """Also those of other kinds, those that were told before the door was, and wrong clocks."""
    found = timeline_of(told)

    for at in range(8 if found.removed else 1 + max(min(h, r) for _, h, r, _, _ in told)):
        replayed = model(told, at).get(DOOR)
        assert (None if replayed is None else replayed["state"]) == state_at(found, at)


@settings(deadline=None)
@given(lives())
def test_intervals_are_joined_and_count_the_events_that_say_so(told: list[Told]) -> None:
    """Each ends where the next begins, in another state."""
    found = timeline_of(told)

    about = sorted(
        ((min(h, r), n, e) for n, h, r, _, e in told if e.door_id == DOOR), key=lambda one: one[:2]
    )
    born = next(i for i, (*_, e) in enumerate(about) if isinstance(e, DoorAdded))
    rows = list(found)
    for before, after in pairwise(rows):
        assert before.end_ns == after.start_ns
        assert before.state != after.state
    for i, row in enumerate(rows):
        goes_on = i == len(rows) - 1 and not found.removed
        agree = [
            number
            for ns, number, event in about[born:]
            if row.start_ns <= ns and (ns < row.end_ns or goes_on) and sets(event) == row.state
        ]
        assert (agree[0], len(agree)) == (row.event, row.sightings)
        assert row.start_ns < row.end_ns or goes_on
        assert row.start_ns <= row.end_ns


def seen(*states: tuple[int, DoorState]) -> EventBatch:
    """Return a door's adding at time 0 and sightings at these times."""
    sightings = [DoorObserved(door_id=DOOR, happened_ns=ns, state=state) for ns, state in states]
    return batch_of(
        [DoorAdded(door_id=DOOR, happened_ns=0), *sightings],
        recorded_ns=[100] * (len(sightings) + 1),
    )


def removal(ns: int) -> EventBatch:
    """Return the door's removal at a time."""
    event = DoorRemoved(door_id=DOOR, happened_ns=ns)
    return batch_of([event], first_number=9, recorded_ns=[100])


def test_the_last_interval_never_ends_before_it_begins(tmp_path: Path, clock: SteadyClock) -> None:
    """Of a commit that is known at its first nanosecond the others lie after the moment."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.add_door()
        late = clock.now_ns + 10**12
        commit = log.append(
            [DoorObserved(door_id=DOOR, state=state, happened_ns=late) for state in (OPEN, CLOSED)]
        ).commit

        found = log.timeline(DOOR, known_at=commit.recorded_ns)

    assert [UNKNOWN, OPEN, CLOSED] == [interval.state for interval in found]
    assert commit.recorded_ns + 1 == found.start_ns[-1] == found.end_ns[-1]


def test_a_state_of_a_later_version_is_unknown() -> None:
    """As a replay shows it; two such states are the same one."""
    rows = np.zeros(2, layout("DoorObserved").dtype)
    rows["door_id"], rows["state"] = DOOR, [77, 78]
    stamps = np.array([10, 20])
    kinds = np.full(2, DoorObserved.kind, np.uint8)
    later = EventBatch(stamps, kinds, stamps, stamps, {DoorObserved.kind: rows}, {})

    (interval,) = timeline([seen(), later], DOOR, end_ns=30)

    assert (UNKNOWN, 3) == (interval.state, interval.sightings)


def test_a_cut_keeps_what_lies_between() -> None:
    """Intervals are cut at both ends; the last one, that goes on, is there at its end, too."""
    found = timeline([seen((10, OPEN), (20, CLOSED), (30, OPEN))], DOOR, end_ns=30)

    assert [(10, 15, OPEN)] == [i[:3] for i in found.between(10, 15)]
    assert [(5, 10, UNKNOWN), (10, 12, OPEN)] == [i[:3] for i in found.between(5, 12)]
    assert [(20, 30, CLOSED), (30, 30, OPEN)] == [i[:3] for i in found.between(20)]
    assert [(30, 30, OPEN)] == [i[:3] for i in found.between(30)]
    assert [] == list(found.between(31))
    assert [] == list(found.between(None, 0))
    assert list(found) == list(found.between())


def test_a_cut_before_the_removal_knows_nothing_of_it() -> None:
    """`removed` is said where the last interval ends by it."""
    gone = removal(25)
    found = timeline([seen((10, OPEN)), gone], DOOR)

    assert not found.between(None, 20).removed
    assert found.between(5, 25).removed
    assert found.between(12).removed
    assert [] == list(found.between(25))


def test_the_frame_has_the_same_rows() -> None:
    """Times in UTC, the state as a category."""
    frame = timeline([seen((10, OPEN))], DOOR, end_ns=30).to_pandas()

    columns = ["start", "end", "state", "event", "sightings", "seen_seconds"]
    assert columns == list(frame.columns)
    assert "datetime64[ns, UTC]" == str(frame.dtypes["end"])
    assert ["UNKNOWN", "OPEN"] == frame.state.tolist()
    assert [10, 20] == (frame.end - frame.start).astype("int64").tolist()


def test_a_log_is_asked_by_name_and_moments(tmp_path: Path) -> None:
    """Ends: the moment asked for, else the log's end; retracted sightings never were."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(name="front", at="2026-03-01T08:00")
        log.observe(door, "open", at="2026-03-01T09:00")
        wrong = log.observe(door, "closed", at="2026-03-01T10:00").commit
        log.append([Retracted(first_event=wrong.first_event, last_event=wrong.first_event)])
        log.observe(door, "closed", at="2026-03-01T11:00")
        known = log.timeline(door, known_at=wrong.recorded_ns, until="2026-03-01T12:00")
        noon = log.timeline("front", at="2026-03-01T12:00")
        cut = log.timeline(door, since="event:2", until="2026-03-01T11:30")
        early = log.timeline(door, at="2026-03-01T07:00")
        whole, end_ns = log.timeline(door), log.end_ns()

    hour_ns = 3600 * 10**9
    assert [UNKNOWN, OPEN, CLOSED] == [i.state for i in noon]
    assert [1, 2, 1] == (noon.duration_ns // hour_ns).tolist()
    assert 2 * hour_ns == noon.total_ns(OPEN)
    assert end_ns == whole.end_ns[-1]
    assert [1, 1, 2] == (known.duration_ns // hour_ns).tolist()
    assert [(UNKNOWN, 3600), (OPEN, 7200), (CLOSED, 1800)] == [
        (i.state, i.duration_ns // 10**9) for i in log.timeline(door, until="2026-03-01T11:30")
    ]
    assert [OPEN, CLOSED] == [i.state for i in cut]
    assert 0 == len(early)


def test_a_door_that_never_was_is_an_error(tmp_path: Path) -> None:
    """By its number, by its name; and times in the wrong order."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door()
        for name in (DoorId(7), "side"):
            with pytest.raises(UnknownDoorError, match=f"{name}"):
                log.timeline(name)
        with pytest.raises(MomentError, match="swap"):
            log.timeline(door, since="2026-03-02", until="2026-03-01")


def test_since_an_event_whose_clock_was_wrong(tmp_path: Path, clock: SteadyClock) -> None:
    """It counts from when it was recorded, and so does the cut."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door()
        log.append([DoorObserved(door_id=door, state=OPEN, happened_ns=2**62)])
        recorded_ns = log.event(1).recorded_ns

        found = log.timeline(door, since="event:1")

    assert [(recorded_ns, OPEN)] == [(i.start_ns, i.state) for i in found]
