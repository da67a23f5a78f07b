"""Replay against the dictionary model: random commands, late events, retractions, moments."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId, DoorMap, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    PatrolStarted,
    Retracted,
)
from semmap_log.core.model.meaning import ALL_CHANGED
from semmap_log.errors import CommandError, InvalidEventError
from semmap_log.log.door_log.known_past import Validator
from semmap_log.log.replay.keyframes import decode, encode
from tests.conftest import SteadyClock
from tests.core.folds.dictionary_model import ALL, Told, model

START_NS = 1_772_400_000 * 10**9


def random_event(dice: random.Random, number: int, now_ns: int) -> Event:
    """Return an event of few doors, few values, and times that are late, equal, or to come."""
    happened = dice.choice(
        [
            None,
            None,
            None,
            now_ns - dice.randrange(0, 50) * 10**6,
            now_ns + 10**9,
            START_NS + dice.randrange(40) * 10**6,
        ]
    )
    door_id = DoorId(dice.randint(0, 3))
    place = dict.fromkeys(("x", "y", "theta", "width"), float(dice.randint(0, 3)))
    state = dice.choice(list(DoorState))
    kind = dice.randrange(10)
    if kind <= 1:
        return DoorAdded(
            door_id=door_id,
            happened_ns=happened,
            state=state,
            **(place if dice.random() < 0.8 else {}),
        )
    if kind <= 3:
        return DoorUpdated(
            door_id=door_id,
            happened_ns=happened,
            state=state,
            prob_open=0.25,
            prob_closed=0.5,
            changed=Changed(dice.randint(1, int(ALL_CHANGED))),
            **place,
        )
    if kind == 4:
        return DoorRemoved(door_id=door_id, happened_ns=happened)
    if kind == 5:
        return DoorAnnotated(
            door_id=door_id,
            happened_ns=happened,
            key=dice.choice("ab"),
            value=dice.choice(["", "x", "y"]),
        )
    if kind == 6:
        return DoorPassed(door_id=door_id, happened_ns=happened, passed=dice.random() < 0.5)
    if kind == 7 and number and dice.random() < 0.4:
        first = dice.randrange(number)
        return Retracted(first_event=first, last_event=min(number - 1, first + dice.randrange(3)))
    if kind == 8:
        return DoorRequested(door_id=door_id, happened_ns=happened, state=state)
    if kind == 9 and dice.random() < 0.3:  # about no door
        return PatrolStarted(patrol=dice.randint(1, 9), happened_ns=happened)
    return DoorObserved(door_id=door_id, happened_ns=happened, state=state, accuracy_open=0.9)


def random_log(path: Path, dice: random.Random, commits: int) -> list[Told]:
    """Write a log of random commits, opened anew now and then; return what it was told."""
    clock = SteadyClock(START_NS)
    told: list[Told] = []
    log = sl.create(path, tz="UTC", clock=clock, entropy=dice.randbytes)
    for _ in range(commits):
        if dice.random() < 0.15:
            log.close()
            log = sl.append(path, clock=clock, entropy=dice.randbytes)
        events = list(_allowed(log, dice, dice.randint(1, 4)))
        if events:
            commit = log.append(events).commit
            for i, event in enumerate(events):
                recorded = commit.recorded_ns + i
                clock_ns = commit.wall_clock_ns
                happened = clock_ns if event.happened_ns is None else event.happened_ns
                told.append((commit.first_event + i, happened, recorded, commit.recorded_ns, event))
    log.close()
    return told


def _allowed(log: sl.DoorLogWriter, dice: random.Random, count: int) -> Iterator[Event]:
    """Yield those of `count` random events that the map lets pass."""
    number = log.state.event + 1
    validator = Validator(log.door_index, number, past=log.known_past)
    for _ in range(count):
        try:
            event = random_event(dice, number, log._writer.clock.wall_ns())
            validator.check(event)
        except (CommandError, InvalidEventError):
            continue
        yield event
        number += 1


def plain(door_map: DoorMap) -> dict[int, dict[str, Any]]:
    """Return a door map in the model's form."""
    return {
        door.door_id: {name: getattr(door, name) for name in ALL}
        | {"seen": door.last_seen_ns, "said": dict(door.annotations)}
        for door in door_map.doors.values()
    }


def expected(doors: dict[int, dict[str, Any]]) -> dict[int, dict[str, Any]]:
    """Return the model's answer without what was taken back."""
    return {
        door_id: door
        | {"said": {key: value for key, value in sorted(door["said"].items()) if value}}
        for door_id, door in doors.items()
    }


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32))
def test_every_moment_is_what_the_model_says(seed: int) -> None:
    """at, known_at, both together and event: at each event's own times, before, and between."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        told = random_log(Path(folder) / "log", dice, commits=25)
        if not told:
            return
        log = sl.read(Path(folder) / "log")
        times = sorted(
            {
                t
                for number, happened, recorded, commit, _ in told
                for t in (happened, recorded, commit, commit - 1)
            }
        )
        for _ in range(12):
            at, known_at = dice.choice([None, *times]), dice.choice([None, *times])
            event = dice.choice([None, dice.randrange(len(told))])

            doors = log.replay(at=at, known_at=known_at, event=event)

            assert repr(expected(model(told, at, known_at, event))) == repr(plain(doors))


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32))
def test_the_fold_commutes_and_a_keyframe_is_the_state(seed: int) -> None:
    """Batches in any order, cut anywhere, through a keyframe or not: the same arrays."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        random_log(Path(folder) / "log", dice, commits=15)
        batches = list(sl.read(Path(folder) / "log").visible_batches())
    in_order = DoorMapState()
    for batch in batches:
        in_order.apply(batch)
    shuffled = DoorMapState()
    pieces = [batch.select(batch.number == n) for batch in batches for n in batch.number]
    dice.shuffle(pieces)
    for i, piece in enumerate(pieces):
        shuffled.apply(piece)
        if i == len(pieces) // 2:
            restored = decode(encode(shuffled))
            assert restored is not None
            shuffled = restored

    assert encode(in_order) == encode(shuffled)


def test_the_writer_holds_the_same_state_as_a_replay(tmp_path: Path) -> None:
    """What commands are checked against is what a reader would see, after every reopening."""
    dice = random.Random(3)
    random_log(tmp_path / "log", dice, commits=60)

    with sl.append(tmp_path / "log") as log:
        assert repr(log.replay().doors) == repr(log.state.door_map().doors)
        log.append([Retracted(first_event=0, last_event=5)])
        assert repr(log.replay().doors) == repr(log.state.door_map().doors)


def test_a_sighting_outranks_an_update_only_by_being_later(tmp_path: Path) -> None:
    """The later of the two wins, whatever the accuracy; a late one changes the past alone."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(at="2026-03-01T08:00")
        log.observe(door, "open", at="2026-03-01T12:00")
        log.update_door(door, state="closed", at="2026-03-01T10:00")

        assert log.replay()[door].state is DoorState.OPEN
        assert log.replay(at="2026-03-01T11:00")[door].state is DoorState.CLOSED
        assert log.replay(at="2026-03-01T09:00")[door].state is DoorState.UNKNOWN
        assert log.replay(at="2026-03-01T07:59").doors == {}


def test_a_retraction_hides_only_from_later_knowledge(tmp_path: Path) -> None:
    """known_at before it still shows what was believed then."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(state="closed")
        seen = log.observe(door, "open").commit
        log.append([Retracted(first_event=seen.first_event, last_event=seen.first_event)])

        assert log.replay()[door].state is DoorState.CLOSED
        assert log.replay(known_at=seen.recorded_ns)[door].state is DoorState.OPEN
        assert log.replay(event=seen.first_event)[door].state is DoorState.OPEN
        assert [False, True, False] == [entry.retracted for entry in log.history()]


def test_a_removal_before_the_adding_is_of_no_door(tmp_path: Path, clock: SteadyClock) -> None:
    """In one commit: a door said to come in the future, which counts from its recorded time."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.add_door()
        log.append(
            [
                DoorObserved(door_id=DoorId(1), state=DoorState.OPEN),
                DoorAdded(door_id=DoorId(2), happened_ns=clock.now_ns + 10**12),
                DoorRemoved(door_id=DoorId(2)),
            ]
        )

        assert [1, 2] == sorted(log.replay().doors)
        assert log.state.is_present(2)
        assert not log.timeline(DoorId(2)).removed


def test_a_removal_while_the_clock_is_behind_is_refused(tmp_path: Path, clock: SteadyClock) -> None:
    """Without a time of its own it would lie before the adding, and leave the door there."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door()
        later = log.add_door()
        clock.now_ns -= 1000 * 10**9
        with pytest.raises(CommandError, match="the clock has gone back"):
            log.remove_door(door)
        clock.now_ns += 2000 * 10**9

        log.remove_door(door)

        assert [later] == list(log.replay().doors)


def test_a_commit_is_known_whole_or_not_at_all(tmp_path: Path, clock: SteadyClock) -> None:
    """A moment inside a commit's own nanoseconds shows all of it."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        commit = log.append([DoorAdded(door_id=DoorId(n)) for n in range(1, 6)]).commit

        assert 5 == len(log.replay(known_at=commit.recorded_ns))
        assert 0 == len(log.replay(known_at=commit.recorded_ns - 1))


def test_diff_names_what_changed_and_the_events_that_did_it(tmp_path: Path) -> None:
    """Added, removed and changed between two moments; events with T1 < happened <= T2."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        stays = log.add_door(x=0, y=0, theta=0, width=1, at="2026-03-01T08:00")
        goes = log.add_door(at="2026-03-01T08:00")
        log.update_door(stays, state="open", at="2026-03-01T09:00")
        log.remove_door(goes, at="2026-03-01T10:00")
        comes = log.add_door(at="2026-03-01T10:00")

        found = log.diff("2026-03-01T08:00", "2026-03-01T10:00")

    assert [comes] == [door.door_id for door in found.added]
    assert [goes] == [door.door_id for door in found.removed]
    assert [(stays, "state", DoorState.UNKNOWN, DoorState.OPEN)] == [
        (c.door.door_id, c.field, c.before, c.after) for c in found.changed
    ]
    assert [2, 3, 4] == [entry.number for entry in found.events]


@pytest.mark.parametrize(
    "ask",
    [
        lambda log: log.replay(event=2),
        lambda log: log.replay("event:2"),
        lambda log: log.replay(known_at="event:2"),
        lambda log: log.timeline(1, at="event:2"),
        lambda log: log.timeline(1, until="event:2"),
        lambda log: log.diff("event:0", "event:2"),
        lambda log: log.diff("event:2", "event:3"),
        lambda log: list(log.history(since="event:3")),
        lambda log: list(log.batches(until="event:3")),
        lambda log: log.event(2),
        lambda log: log.entry(2),
        lambda log: probabilities(log, at="event:2"),
    ],
)
def test_a_number_behind_the_end_is_an_error_that_names_the_last(ask, tmp_path: Path) -> None:
    """Nobody knows what is true after an event that has not come."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        log.add_door()
    with pytest.raises(sl.SemmapError, match=r"there is no event [23]; the last is event 1\.$"):
        ask(sl.read(tmp_path / "log"))


def test_a_range_ends_behind_the_last_event(tmp_path: Path) -> None:
    """Half-open: `until` is the next number, from which a later question goes on."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        log.add_door()

        assert 2 == sum(map(len, log.batches("event:0", "event:2")))
        assert 0 == sum(map(len, log.batches("event:2")))
        assert 2 == len(log.replay(event=1))
        with pytest.raises(sl.SemmapError, match="from 0 on"):
            log.replay(event=-1)


def test_a_log_without_events_says_so(tmp_path: Path) -> None:
    """There is no last event to name."""
    log = sl.create(tmp_path / "log", tz="UTC")

    with pytest.raises(sl.SemmapError, match="there is no event 0; the log has none yet"):
        log.replay("event:0")
    assert [] == list(log.history(since="event:0"))
    log.close()
