"""Why a door was in a state, against a plain fold of the exported lines, event by event."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.analysis.beliefs import explain, probabilities
from semmap_log.core.folds.explanation import Explanation, StateReason
from semmap_log.errors import SemmapError, UnknownDoorError
from semmap_log.interop.exporting.log_files import write_event_lines
from semmap_log.log.replay.replay import Scope

sys.path.insert(0, str(Path(__file__).parents[3] / "tools"))
from steady_clock import SteadyClock

OFFICE = Path(__file__).parents[3] / "recordings" / "office"

START_NS = 1_772_400_000 * 10**9
SECOND_NS = 10**9
ALL = 10**9
"""No event has such a number."""

Line = dict[str, Any]


class Known(NamedTuple):
    """What a plain fold knows of a door."""

    state: str | None
    removed: bool = False
    since_ns: int | None = None
    begun_by: int | None = None
    last: int | None = None
    times_told: int = 0
    added_by: int | None = None


def _ns(text: str) -> int:
    whole, _, rest = text.rstrip("Z").partition(".")
    return int(datetime.fromisoformat(f"{whole}+00:00").timestamp()) * SECOND_NS + int(rest)


def _lines(log: Path) -> list[Line]:
    """Return the exported lines, each with when it happened, was recorded and counts."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.jsonl"
        write_event_lines(sl.read(log), path, Scope())
        lines = [json.loads(line) for line in path.read_text().splitlines()]
    for line in lines:
        line["happened"], line["recorded"] = _ns(line["happened"]), _ns(line["recorded"])
        line["folds"] = min(line["happened"], line["recorded"])
    return lines


def _tells(line: Line) -> str | None:
    """Return the state that a line gives its door."""
    if line["kind"] == "DoorPassed":
        return "OPEN" if line["passed"] else None
    return line.get("state") if line["kind"] != "DoorRequested" else None


def _hidden(lines: Iterable[Line], limit: int) -> dict[int, int]:
    """Return the numbers that are retracted, each with the first event that did it."""
    found: dict[int, int] = {}
    for line in lines:
        if line["kind"] == "Retracted" and line["event"] <= limit:
            for number in range(line["first_event"], line["last_event"] + 1):
                found.setdefault(number, line["event"])
    for line in lines:
        if line["kind"] == "Retracted":
            found.pop(line["event"], None)
    return found


def _known(lines: list[Line], door: int, at_ns: int, limit: int = ALL) -> Known:
    """Fold the events up to a moment that have a number up to a limit."""
    hidden = _hidden(lines, limit)
    told = sorted(
        (line["folds"], line["event"], line)
        for line in lines
        if line.get("door_id") == door
        and line["event"] <= limit
        and line["event"] not in hidden
        and line["folds"] <= at_ns
    )
    added = next((one for one in told if one[2]["kind"] == "DoorAdded"), None)
    if added is None:
        return Known(None)
    told = told[told.index(added) :]
    gone = next((one for one in told if one[2]["kind"] == "DoorRemoved"), None)
    if gone is not None:
        return Known(None, True, gone[0], gone[1], gone[1], added_by=added[1])
    words = [(ns, n, state) for ns, n, line in told if (state := _tells(line)) is not None]
    held = [w for w, after in zip(words, [*words[1:], None], strict=True)
            if after is None or after[0] != w[0]]  # fmt: skip
    state = held[-1][2]
    begin = len(held)
    while begin and held[begin - 1][2] == state:
        begin -= 1
    since_ns = held[begin][0]
    same = [n for ns, n, told_state in words if ns >= since_ns and told_state == state]
    return Known(state, False, since_ns, same[0], words[-1][1], len(same), added[1])


def _next(lines: list[Line], door: int, at_ns: int) -> tuple[int, str | None] | None:
    """Return when the door changes after a moment, and to what (None: it is gone)."""
    before = _known(lines, door, at_ns)
    for ns in sorted({line["folds"] for line in lines if line["folds"] > at_ns}):
        now = _known(lines, door, ns)
        if (now.state, now.removed) != (before.state, before.removed):
            return ns, now.state
    return None


def _against(lines: list[Line], door: int, state: str, span: tuple[int, int]) -> set[int]:
    """Return the events of a time that tell another state."""
    found = set()
    for line in lines:
        if line.get("door_id") != door or not span[0] <= line["folds"] <= span[1]:
            continue
        gave_up = line["kind"] == "DoorPassed" and not line["passed"] and state == "OPEN"
        asked = line["kind"] == "DoorRequested" and line["state"] != state
        if gave_up or asked or _tells(line) not in {None, state, "UNKNOWN"}:
            found.add(line["event"])
    return found


def _as_known(told: StateReason) -> Known:
    numbers = [None if e is None else e.number for e in (told.begun_by, told.last, told.added_by)]
    state = _state_name(told.state)
    begun_by, last, added_by = numbers
    return Known(state, told.is_removed, told.since_ns, begun_by, last, told.times_told, added_by)


_DOORS, _STATES = st.integers(1, 2), st.sampled_from(["OPEN", "CLOSED", "UNKNOWN"])
_AGO = st.sampled_from([None, 0, 1, 2, 3, 5])
"""Seconds before the clock, in which many events share a moment; None: when it is recorded."""
_ACTS = st.lists(
    st.one_of(
        st.tuples(st.just("observe"), _DOORS, _STATES, _AGO),
        st.tuples(st.just("update"), _DOORS, _STATES, _AGO),
        st.tuples(st.just("request"), _DOORS, _STATES, _AGO),
        st.tuples(st.just("pass"), _DOORS, st.booleans(), _AGO),
        st.tuples(st.just("remove"), _DOORS, st.just(""), _AGO),
        st.tuples(st.just("retract"), st.integers(0, 30), st.integers(0, 2), st.just(None)),
    ),
    min_size=1,
    max_size=25,
)


def _write(path: Path, acts: Iterable[tuple[Any, ...]]) -> None:
    """Write a log of two doors, in which the acts that are no errors are done, a second apart."""
    clock = SteadyClock(START_NS)
    with sl.create(path, tz="UTC", clock=clock, durability="none", compact=False) as log:
        for name in ("front", "back"):
            log.add_door(name=name, at=START_NS)
        for what, which, value, ago in acts:
            clock.now_ns += SECOND_NS
            when = {} if ago is None else {"at": START_NS + ago * SECOND_NS}
            with suppress(SemmapError):
                if what == "observe":
                    log.observe(which, value, accuracy=0.9, **when)
                elif what == "update":
                    log.update_door(which, state=value, **when)
                elif what == "request":
                    log.request(which, value, **when)
                elif what == "pass":
                    log.passed(which, passed=value, **when)
                elif what == "remove":
                    log.remove_door(which, **when)
                else:
                    log.retract(which, which + value)


def _limit(lines: list[Line], at_ns: int) -> int:
    """Return the last event of the commits that were recorded by a time; -1: there was none."""
    spans = [line.get("commit", [line["event"]] * 2) for line in lines]
    recorded = {line["event"]: line["recorded"] for line in lines}
    return max((last for first, last in spans if recorded[first] <= at_ns), default=-1)


def _moments(lines: list[Line]) -> list[int]:
    """Return moments: just behind each event's recording, and when each counts."""
    return sorted({line["recorded"] + 1000 for line in lines} | {line["folds"] for line in lines})


@given(_ACTS, st.data())
def test_it_is_what_a_plain_fold_of_the_lines_tells(
    acts: list[tuple[Any, ...]], data: st.DataObject
) -> None:
    """True, believed, since when, by which events, what made the difference, and what came next."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        _write(path, acts)
        lines, log = _lines(path), sl.read(path)
        at_ns = data.draw(st.sampled_from(_moments(lines)))
        for door in (1, 2):
            told = explain(log, sl.DoorId(door), at_ns, near_ns=2 * SECOND_NS)

            _check(told, lines, door, at_ns, near_ns=2 * SECOND_NS)


def _check(told: Explanation, lines: list[Line], door: int, at_ns: int, *, near_ns: int) -> None:
    limit = _limit(lines, at_ns)
    true, believed = _known(lines, door, at_ns), _known(lines, door, at_ns, limit)
    assert limit == told.known_event
    assert true == _as_known(told.true)
    assert believed == _as_known(told.believed)
    hidden = _hidden(lines, ALL)
    rested = [believed.last, believed.added_by if true.state is None else None]
    assert next((n for n in rested if n in hidden), None) == _number(told.taken_back)
    rests = [true.last, true.added_by if believed.state is None else None]
    late = next((n for n in rests if n is not None and n > limit), None)
    assert late == _number(told.told_since)
    assert told.agrees == ((true.state, true.removed, true.last)
                           == (believed.state, believed.removed, believed.last))  # fmt: skip
    following = told.next and (told.next.time_ns, _state_name(told.next.state))
    assert _next(lines, door, at_ns) == following
    if true.state is not None:
        assert true.since_ns is not None
        span = min(true.since_ns, at_ns - near_ns), at_ns + near_ns
        assert _against(lines, door, true.state, span) == {e.number for e in told.otherwise}
    for entry in told.otherwise:
        assert hidden.get(entry.number) == entry.retracted_by
    named = {e.retracted_by for e in (*told.otherwise, told.taken_back) if e} - {None}
    assert named == told.retractions.keys()


def _state_name(state: sl.DoorState | None) -> str | None:
    return None if state is None else state.name


def _number(entry: Any) -> int | None:
    return None if entry is None else entry.number


def test_every_moment_of_a_day_that_can_be_checked_by_hand() -> None:
    """The shipped office, its three doors, at each quarter of an hour."""
    lines, log = _lines(OFFICE), sl.read(OFFICE)
    quarter_ns = 900 * SECOND_NS
    for at_ns in range(lines[0]["recorded"] - quarter_ns, lines[-1]["recorded"], quarter_ns):
        for door in (1, 2, 3):
            told = explain(log, sl.DoorId(door), at_ns + 999)

            _check(told, lines, door, at_ns + 999, near_ns=600 * SECOND_NS)


def test_a_reading_that_was_taken_back() -> None:
    """The README's story: at 10:00 the camera misread the main door, at 10:40 somebody noticed."""
    told = sl.read(OFFICE).why("main_door", at="2026-03-02T10:30")

    assert ("OPEN", "CLOSED") == (told.true.state.name, told.believed.state.name)
    assert told.taken_back is not None
    assert 58 == told.taken_back.number
    by = told.retractions[76]
    assert ("facility manager", "it was open: sun on the glass") == (by.actor, by.reason)
    assert told.told_since is None
    assert [58] == [entry.number for entry in told.otherwise]
    assert told.belief is not None
    assert told.belief.p_open > 0.5


def test_of_now_there_is_one_answer() -> None:
    """All that is known was known."""
    log = sl.read(OFFICE)

    told = log.why("main_door")

    assert told.believed is told.true
    assert told.known_event is None
    assert log.end_ns() == told.time_ns
    assert told.next is None


def test_the_belief_is_that_of_probabilities_without_peeking(tmp_path: Path) -> None:
    """What is told later changes what was true, not what could be believed."""
    _write(tmp_path / "log", [("observe", 1, "CLOSED", None)] * 8)
    at_ns = START_NS + 20 * SECOND_NS
    log = sl.read(tmp_path / "log")
    before = log.why("front", at_ns).belief
    (asked,) = probabilities(log, at=at_ns, known_at=at_ns, doors=["front"])

    with sl.append(tmp_path / "log", clock=SteadyClock(START_NS + 60 * SECOND_NS)) as writer:
        for second in range(9, 20):
            writer.observe("front", "open", at=START_NS + second * SECOND_NS)
        writer.retract(4, 7)
    after = sl.read(tmp_path / "log").why("front", at_ns)

    assert _numbers(asked) == _numbers(before) == _numbers(after.belief)
    assert "OPEN" == after.true.state.name
    assert "CLOSED" == after.believed.state.name


def _numbers(belief: Any) -> tuple[float, float, float, bool]:
    return belief.p_open, belief.low, belief.high, belief.is_known


def test_what_was_believed_of_another_time(tmp_path: Path) -> None:
    """With known_at, by what was recorded then, about the moment."""
    _write(tmp_path / "log", [("observe", 1, "OPEN", None), ("observe", 1, "CLOSED", 0)])
    log = sl.read(tmp_path / "log")

    told = log.why("front", START_NS + SECOND_NS // 2, "event:4")

    assert ("CLOSED", "UNKNOWN") == (told.true.state.name, told.believed.state.name)
    assert 4 == told.known_event
    alone = log.why("front", known_at="event:4")
    assert ("OPEN", 4) == (alone.believed.state.name, alone.known_event)


def test_a_door_that_was_not_there(tmp_path: Path) -> None:
    """Not yet, not any more, and not in a log in which nothing was recorded then."""
    _write(tmp_path / "log", [("observe", 1, "OPEN", None), ("remove", 1, "", None)])
    log = sl.read(tmp_path / "log")
    before, after = log.why("front", START_NS - SECOND_NS), log.why("front", "now")

    assert before.true.state is None
    assert not before.true.is_removed
    assert -1 == before.known_event
    assert before.belief is None
    assert before.next is not None
    assert ("UNKNOWN", 0) == (before.next.state.name, before.next.entry.number)
    assert after.true.state is None
    assert after.true.is_removed
    assert "DoorRemoved" == after.true.begun_by.kind
    assert after.next is None


def test_a_door_that_never_was(tmp_path: Path) -> None:
    """It is an error, as everywhere."""
    _write(tmp_path / "log", [])

    with pytest.raises(UnknownDoorError, match="door is called 'side'"):
        sl.read(tmp_path / "log").why("side")
