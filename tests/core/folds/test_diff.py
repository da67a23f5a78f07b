"""A diff says all that is different: applied to the earlier state it gives the later one."""

from __future__ import annotations

import json
import random
import tempfile
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.folds.history import diff
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
)
from semmap_log.errors import CommandError, InvalidEventError
from semmap_log.interop.formats.json.door_json import diff_to_json, door_map_to_json
from semmap_log.log.door_log.known_past import Validator
from tests.conftest import SteadyClock
from tests.test_replay import START_NS, random_event


def _random_event(dice: random.Random, number: int, now_ns: int) -> Event:
    """Return an event as `test_replay` draws them, or one of levels, or of a door on another."""
    happened_ns = dice.choice([None, None, now_ns - dice.randrange(50) * 10**6])
    level = dice.randrange(3)
    drawn = random_event(dice, number, now_ns)
    if dice.random() < 0.15:
        name, elevation = dice.choice(["", "L1", "L2"]), dice.choice([float("nan"), 0.0, 3.5])
        return LevelAdded(level=level, name=name, elevation=elevation, happened_ns=happened_ns)
    if dice.random() < 0.05:
        cells = np.zeros((2, 2), np.int8)
        return FloorMap(level=level, resolution=0.05, origin_x=0.0, origin_y=0.0, cells=cells,
                        happened_ns=happened_ns)  # fmt: skip
    if isinstance(drawn, (DoorAdded, DoorUpdated)) and dice.random() < 0.5:
        return replace(drawn, level=level)
    if dice.random() < 0.1:
        return DoorUpdated(door_id=DoorId(dice.randint(1, 4)), changed=Changed.POSE, level=level,
                           x=1.0, y=2.0, theta=dice.random())  # fmt: skip
    return drawn


def _random_log(path: Path, dice: random.Random, commits: int) -> sl.DoorLog:
    """Write random commits of up to four events each."""
    clock = SteadyClock(START_NS)
    with sl.create(path, tz="UTC", clock=clock, entropy=dice.randbytes) as log:
        for _ in range(commits):
            events = list(_allowed(log, dice, clock))
            if events:
                log.append(events)
    return sl.read(path)


def _allowed(log: sl.DoorLogWriter, dice: random.Random, clock: SteadyClock) -> Iterator[Event]:
    number = log.state.event + 1
    validator = Validator(log.door_index, number, past=log.known_past)
    for _ in range(dice.randint(1, 4)):
        try:
            event = _random_event(dice, number, clock.now_ns)
            validator.check(event)
        except (CommandError, InvalidEventError):
            continue
        yield event
        number += 1


def _moments(log: sl.DoorLog, dice: random.Random) -> Iterator[tuple[Any, Any]]:
    """Yield pairs of moments, the earlier first: of time, of event numbers, of both."""
    entries = list(log.history())
    times = sorted({t for e in entries for t in (e.happened_ns, e.recorded_ns, e.recorded_ns - 1)})
    for _ in range(12):
        yield tuple(sorted(dice.choices(times, k=2)))
        yield tuple(f"event:{n}" for n in sorted(dice.choices(range(len(entries)), k=2)))
        yield dice.choice(times), f"event:{dice.randrange(len(entries))}"
        yield dice.choice(times), None


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32))
def test_applied_to_the_first_state_it_gives_the_second(seed: int) -> None:
    """In every field of every door and level, in the moment that the map is of, and in JSON."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        log = _random_log(Path(folder) / "log", dice, commits=25)
        for first, second in _moments(log, dice):
            before, after = log.replay(first), log.replay(second)
            found = log.diff(first, second)

            assert _said(after) == _said(found.applied_to(before))
            assert door_map_to_json(after) == _patched(
                door_map_to_json(before), json.loads(json.dumps(diff_to_json(found)))
            )


def _said(door_map: DoorMap) -> str:
    """Return all that a door map says, in a form in which NaN is equal to itself."""
    said = replace(door_map, doors=dict(door_map.doors), levels=dict(door_map.levels))
    return repr([getattr(said, field.name) for field in fields(said)])


def _patched(before: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    """Return what a program in another language would make of `replay --json`, `diff --json`."""
    doors = {door["door_id"]: dict(door) for door in before["doors"]}
    for door in found["removed"]:
        del doors[door["door_id"]]
    doors |= {door["door_id"]: dict(door) for door in found["added"]}
    for change in found["changed"] + found["heard"]:
        assert change["before"] == doors[change["door_id"]][change["field"]]
        doors[change["door_id"]][change["field"]] = change["after"]
    levels = {level["level"]: level for level in before["levels"]}
    for change in found["levels"]:
        assert change["before"] == levels.pop(change["level"], None)
        if change["after"]:
            levels[change["level"]] = change["after"]
    for door in doors.values():
        door["name"] = door["annotations"].get("name")
        door["level_name"] = levels.get(door["level"], {"name": None})["name"]
    return {
        "event": found["to_event"],
        "at": found["to"],
        "known_at": None,
        "levels": [levels[number] for number in sorted(levels)],
        "doors": [doors[door_id] for door_id in sorted(doors)],
    }


@pytest.fixture
def log(tmp_path: Path) -> Iterator[sl.DoorLogWriter]:
    """Three doors at 08:00; at 09:00 one is seen as before, one opened, one removed; a level."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for _ in range(3):
            log.add_door(state="closed", at="2026-03-01T08:00")
        log.observe(1, "closed", at="2026-03-01T09:00")
        log.update_door(2, state="open", at="2026-03-01T09:00")
        log.remove_door(3, at="2026-03-01T09:00")
        log.append([LevelAdded(level=1, name="L1", happened_ns=1772355600 * 10**9)])
        yield log


def test_what_was_only_heard_of_is_no_change(log: sl.DoorLogWriter) -> None:
    """A door seen as it was stays out of `changed` and of the table; so does a level."""
    found = log.diff("2026-03-01T08:30", "2026-03-01T09:30")

    assert [(2, "state")] == [(c.door.door_id, c.field) for c in found.changed]
    assert [(1, "last_seen_ns"), (1, "last_event"), (2, "last_seen_ns"), (2, "last_event")] == [
        (c.door.door_id, c.field) for c in found.heard
    ]
    assert [(1, None, "L1")] == [(c.number, c.before, c.after.name) for c in found.levels]


def test_a_diff_of_nothing_but_sightings_is_empty(log: sl.DoorLogWriter) -> None:
    """It is false, and still leads from one state to the other."""
    log.observe(1, "closed", at="2026-03-01T10:00")
    found = log.diff("2026-03-01T09:30", "2026-03-01T10:30")

    assert not found
    assert 2 == len(found.heard)
    assert 1772359200 * 10**9 == found.applied_to(found.before)[DoorId(1)].last_seen_ns


@pytest.mark.parametrize(
    ("moment", "why"),
    [
        ("2026-03-01T07:00", "door 3: expected Door.* before the change, got none"),
        ("2026-03-01T09:30", "door 3: expected Door.* got none; this is not the map"),
    ],
)
def test_another_map_is_refused(log: sl.DoorLogWriter, moment: str, why: str) -> None:
    """A diff is of two moments: it is not poured over a third."""
    found = log.diff("2026-03-01T08:30", "2026-03-01T09:30")

    with pytest.raises(CommandError, match=why):
        found.applied_to(log.replay(moment))


def test_another_value_is_refused(log: sl.DoorLogWriter) -> None:
    """A field, a stamp, a level or a door that is there already: each is named."""
    found = log.diff("2026-03-01T08:30", "2026-03-01T09:30")
    back = diff(found.after, found.before)
    doors, levels = dict(found.before.doors), dict(found.after.levels)
    moved = replace(found.before, doors={**doors, 2: replace(doors[2], state=sl.DoorState.MOVING)})
    unheard = replace(found.before, doors={**doors, 1: replace(doors[1], last_event=None)})
    gone = replace(found.before, doors={3: doors[3]})
    named = replace(found.before, levels=levels)

    for other, why in (
        (moved, "state of door 2: expected .*CLOSED.* got .*MOVING"),
        (unheard, "last_event of door 1: expected 0 before the change, got none"),
        (gone, "door 2: expected a door before the change, got none"),
        (named, "level 1: expected none before the change, got Level"),
    ):
        with pytest.raises(CommandError, match=why):
            found.applied_to(other)
    with pytest.raises(CommandError, match="door 3: expected none before"):
        back.applied_to(replace(found.after, doors=doors))
    assert _said(found.before) == _said(back.applied_to(found.after))
