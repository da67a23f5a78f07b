"""Compares the answers of a log that was trimmed with those of the whole log."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from typing import Any

import semmap_log as sl
from fault_injection.oracle.doors import stamp
from fault_injection.trimming.commands import row_of
from fault_injection.trimming.life import Life, WrongError
from fault_injection.trimming.whole_log import HOUR_NS, WholeLog
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.errors import HorizonError, SemmapError

Moment = dict[str, int]
SHOWN = ("level", "x", "y", "theta", "width", "prob_open", "prob_closed")


QUESTIONS = 6
"""About moments, at each look; others beside them."""


def examine(life: Life, dice: random.Random) -> None:
    """Ask a log what is in it, and what was true.

    Raises:
        WrongError: One is not that of the whole log, and no refusal of what is gone for its age.
    """
    life.verb("verify")
    log = sl.read(life.path)
    _check_history(life.whole, log)
    for _ in range(QUESTIONS):
        check_doors(life.whole, log, drawn_moment(life.whole, dice))
    for name, at in life.whole.pins().items():
        check_doors(life.whole, log, {"at": at}, asked={"at": f"pin:{name}"})
    check_doors(life.whole, log, {})
    doors = [door["door_id"] for door in life.whole.doors()["doors"]]
    if doors:
        _check_timeline(life.whole, log, dice.choice(doors), dice)
    if doors and dice.random() < 0.2:
        _check_why(life.whole, log, dice.choice(doors), dice)
    life.checked += QUESTIONS


def drawn_moment(whole: WholeLog, dice: random.Random) -> Moment:
    """Return some of `at`, `known_at` and `event`; often near the horizon."""
    row = dice.choice(list(whole.rows.values()))
    commit = whole.commit_of(row["event"])
    happened = stamp(row)[0] + dice.choice((-1, 0, 0, 1, 10**9, 10**11))
    recorded = dice.choice((commit.recorded_ns, commit.closed_ns)) + dice.choice((-1, 0, 1, 10**8))
    if whole.horizon and dice.random() < 0.3:
        happened = recorded = whole.horizon_ns + dice.choice((0, 1, 2, 1000, 10**6, 10**9, -1))
    moment = {"at": happened, "known_at": recorded, "event": dice.randint(0, whole.last)}
    names = dice.choices((("at",), ("known_at",), ("at", "known_at"), ("event",), ("at", "event")),
                         (4, 4, 4, 1, 1))[0]  # fmt: skip
    return {name: max(1 - (name == "event"), moment[name]) for name in names}


def check_doors(
    whole: WholeLog,
    log: sl.DoorLog,
    moment: Moment,
    *,
    asked: Mapping[str, Any] | None = None,
) -> None:
    """Compare the doors of a moment.

    Args:
        whole: What is true.
        log: Is asked.
        moment: The moment.
        asked: The same, as the log is asked; default: as it is.
    """
    try:
        doors = log.replay(**dict[str, Any](moment if asked is None else asked))
    except HorizonError as error:
        if asked is not None or not whole.may_refuse(**moment):
            raise WrongError(f"replay {asked or moment}: {error}") from None
        return
    except SemmapError as error:
        raise WrongError(f"replay {asked or moment}: {error}") from error
    _compare(whole, shown(doors), whole.doors(**moment), f"replay {asked or moment}")


def shown(doors: DoorMap) -> dict[str, Any]:
    """Return a door map as the whole log shows it."""
    return {
        "levels": [
            {"level": one.level, "name": one.name or None, "elevation": _number(one.elevation),
             "floor_map_event": one.floor_map_event}
            for one in doors.levels.values()
        ],
        "doors": [_shown(door, doors) for door in doors.doors.values()],
    }  # fmt: skip


def _shown(door: Door, doors: DoorMap) -> dict[str, Any]:
    level = doors.levels.get(door.level)
    return {
        "door_id": int(door.door_id),
        "name": door.name,
        "level": door.level,
        "level_name": (level.name if level else None) or None,
        **{name: _number(getattr(door, name)) for name in SHOWN[1:]},
        "state": door.state.name,
        "last_seen": door.last_seen_ns,
        "last_event": door.last_event,
        "annotations": dict(door.annotations),
    }


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def _compare(whole: WholeLog, found: Any, expected: Any, what: str) -> None:
    there, wanted = ([d["door_id"] for d in one["doors"]] for one in (found, expected))
    if there != wanted or found["levels"] != expected["levels"]:
        raise WrongError(f"{what}: doors {there}, {found['levels']}; expected {wanted}, "
                         f"{expected['levels']}")  # fmt: skip
    for one, other in zip(found["doors"], expected["doors"], strict=True):
        if wrong := wrong_values(whole, one, other):
            raise WrongError(f"{what}: door {one['door_id']}: {wrong}")


def wrong_values(whole: WholeLog, found: dict[str, Any], expected: dict[str, Any]) -> str:
    """Say which values of a door are not those expected; empty: all are."""
    wrong = [name for name in expected if found[name] != expected[name]
             and not _is_allowed(whole, name, found, expected)]  # fmt: skip
    return ", ".join(f"{name} {found[name]!r}, expected {expected[name]!r}" for name in wrong)


def _is_allowed(whole: WholeLog, name: str, found: Any, expected: Any) -> bool:
    """Tell whether a value differs as a trimming may leave it."""
    door = found["door_id"]
    of_door = [row for row in whole.thinned if row["door_id"] == door]
    if name == "last_event":
        return bool(of_door) or any(why == "redacted" for why in whole.gone.values())
    if name == "last_seen":
        was = expected["last_seen"]
        is_same_hour = found["last_seen"] // HOUR_NS == was // HOUR_NS
        is_gone = any(stamp(row)[0] == was for row in of_door)
        return is_gone and is_same_hour and bool(found["last_seen"] < was)
    return False


def _check_history(whole: WholeLog, log: sl.DoorLog) -> None:
    """Compare all that is told of each event that is left, who and why included."""
    hidden = whole.hidden()
    found = {entry.number: entry for entry in log.history()}
    wanted = whole.rows.keys() - whole.gone.keys()
    if found.keys() != wanted:
        more, less = sorted(found.keys() - wanted), sorted(wanted - found.keys())
        kinds = [whole.rows[n]["kind"] if n in whole.rows else "?" for n in more + less]
        raise WrongError(f"history has events {more}, and lacks {less}: {kinds}")
    for number, entry in found.items():
        row, commit = whole.rows[number], whole.commit_of(number)
        said = row_of(entry.event) | {"event": number, "recorded": entry.recorded_ns,
                                      "happened": entry.happened_ns}  # fmt: skip
        note = (entry.actor, entry.source, entry.reason, entry.correlation)
        if repr(sorted(said.items())) != repr(sorted(row.items())):
            raise WrongError(f"history: {said}; expected {row}")
        if note != commit.note or entry.command_id != commit.command_id:
            raise WrongError(f"history: event {number} by {note}; expected {commit.note}")
        if entry.retracted != (number in hidden):
            raise WrongError(f"history: event {number}: retracted: {entry.retracted}")
    _check_history_of_doors(whole, log)


def _check_history_of_doors(whole: WholeLog, log: sl.DoorLog) -> None:
    """Compare which events each door that is there has."""
    for door in (one["door_id"] for one in whole.doors()["doors"]):
        there = [number for number, row in sorted(whole.rows.items())
                 if row.get("door_id") == door and number not in whole.gone]  # fmt: skip
        found = [entry.number for entry in log.history(DoorId(door))]
        if found != there:
            raise WrongError(f"history {door}: events {found}, expected {there}")


def _check_timeline(whole: WholeLog, log: sl.DoorLog, door: int, dice: random.Random) -> None:
    """Compare the states in a door's timeline with those of some moments within."""
    moment = {k: v for k, v in drawn_moment(whole, dice).items() if k == "known_at"}
    try:
        line = log.timeline(DoorId(door), known_at=moment.get("known_at"))
    except HorizonError as error:
        if not whole.may_refuse(**moment):
            raise WrongError(f"timeline {door} {moment}: {error}") from None
        return
    except SemmapError as error:
        raise WrongError(f"timeline {door} {moment}: {error}") from error
    intervals = list(line)
    for row in dice.sample(list(whole.rows.values()), min(4, len(whole.rows))):
        at = stamp(row)[0]
        if at < whole.horizon_ns or (intervals and at >= intervals[-1].end_ns):
            continue
        states = [one.state.name for one in intervals if one.start_ns <= at < one.end_ns]
        state = whole.state(door, at=at, **moment)
        if (states[0] if states else None) != state:
            raise WrongError(f"timeline {door} {moment}: at {at} {states}, expected {state}")


def _check_why(whole: WholeLog, log: sl.DoorLog, door: int, dice: random.Random) -> None:
    """Compare what was true, and what was believed."""
    row = dice.choice(list(whole.rows.values()))
    at = max(1, stamp(row)[0] + dice.choice((0, 1, 10**9)))
    try:
        why = log.why(DoorId(door), at=at)
    except HorizonError as error:
        if not whole.may_refuse(at=at, known_at=at):
            raise WrongError(f"why {door} at {at}: {error}") from None
        return
    except SemmapError as error:
        raise WrongError(f"why {door} at {at}: {error}") from error
    found = [one.state.name if one.state is not None else None for one in (why.true, why.believed)]
    expected = [whole.state(door, at=at), whole.state(door, at=at, known_at=at)]
    if found != expected:
        raise WrongError(f"why {door} at {at}: true, believed {found}, expected {expected}")
