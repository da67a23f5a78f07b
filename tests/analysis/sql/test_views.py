"""The views of a log, each against plain Python over the exported JSON lines."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("duckdb")

import semmap_log as sl
from semmap_log.analysis.beliefs import probabilities
from semmap_log.core.arrow.table import COLUMNS
from semmap_log.interop.exporting.log_files import export
from semmap_log.log.replay.read_model.indexing import index
from semmap_log.store.compaction import compact
from tests.analysis.sql import plain_log as plain
from tests.analysis.sql.full_logs import full_log

SEEDS = range(2)
TABLES = ("none", "all", "half", "compacted")
"""Which tables of the read model there are."""


@pytest.fixture(scope="module", params=[(seed, tables) for seed in SEEDS for tables in TABLES],
                ids=lambda param: f"{param[0]}-{param[1]}")  # fmt: skip
def asked(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[sl.DoorLog, list[plain.Event]]:
    """A log with some tables beside it, and its events as an export tells them."""
    seed, tables = request.param
    folder = tmp_path_factory.mktemp("views")
    path = full_log(folder / "log", seed)
    export(sl.read(path), folder / "events.jsonl")
    if tables == "compacted":
        compact(path)
    if tables != "none":
        made = index(path).made
        assert made
        if tables == "half":
            for name in random.Random(seed).sample(made, len(made) // 2):
                (path / "index" / f"{Path(name).stem}.json").unlink()
    return sl.read(path), plain.events_of(folder / "events.jsonl")


Asked = tuple[sl.DoorLog, list[plain.Event]]


def rows(log: sl.DoorLog, query: str) -> list[tuple[Any, ...]]:
    found: list[tuple[Any, ...]] = log.sql(query).fetchall()
    return found


def us(ns: Any) -> Any:
    return None if ns is None else ns // 1000


def instant(us: int) -> str:
    return f"make_timestamptz({us})"


def test_events(asked: Asked) -> None:
    """Each event once, the live end too, with who and why, and marked where taken back."""
    log, events = asked
    texts = ("actor", "source", "reason", "correlation")
    expected = [
        (e["event"], e["kind"], e.get("door_id"), us(e["happened_ns"]), us(e["recorded_ns"]),
         e["happened_ns"], e["recorded_ns"], us(e["happened_given"]),
         *(e.get(text) for text in texts), e["command_id"], e["retracted"])
        for e in events
    ]  # fmt: skip

    found = rows(
        log,
        f"""
        select event, kind, door_id, epoch_us(happened), epoch_us(recorded), happened_ns,
            recorded_ns, epoch_us(happened_given), {", ".join(texts)}, command_id, retracted
        from events order by event""",
    )

    assert expected == found
    assert any(e["retracted"] for e in events)
    assert any(e["happened_ns"] != e["happened_given"] for e in events)


NAMES = [c.name for c in COLUMNS if c.kinds and c.name not in {"at", "door_id"}
         and not c.name.startswith("cells")]  # fmt: skip
"""The fields of events."""


def test_fields(asked: Asked) -> None:
    """Every field of every kind, side by side; and one alone, which may come from fewer bytes."""
    log, events = asked
    expected = {name: [_told(event.get(name)) for event in events] for name in NAMES}
    chosen = ", ".join(NAMES)

    found = rows(log, f"select {chosen} from events order by event")

    assert expected == dict(zip(NAMES, map(list, zip(*found, strict=True)), strict=True))
    for name in ("state", "level", "prob_open", "changed", "opening", "passed", "value"):
        alone = [value for (value,) in rows(log, f"select {name} from events")]
        assert sorted(map(repr, expected[name])) == sorted(map(repr, alone)), name


def _told(value: Any) -> Any:
    return "|".join(value) if isinstance(value, list) else value


def test_names_of_then(asked: Asked) -> None:
    """Events bear the name that their door had when they happened."""
    log, events = asked

    found = dict(rows(log, "select event, door_name from events"))

    assert plain.names_as_of(events) == found


def test_filters(asked: Asked) -> None:
    """Whatever is filtered by, the answer is what Python's own filter leaves."""
    log, events = asked
    middle = events[len(events) // 2]
    late = us(middle["happened_ns"])
    early = late - 40 * 10**9
    names = plain.names_as_of(events)
    cases: dict[str, Callable[[plain.Event], bool]] = {
        "kind = 'DoorObserved'": lambda e: e["kind"] == "DoorObserved",
        "kind in ('DoorAdded', 'RobotPose')": lambda e: e["kind"] in {"DoorAdded", "RobotPose"},
        "kind <> 'DoorObserved'": lambda e: e["kind"] != "DoorObserved",
        "door_id = 2": lambda e: e.get("door_id") == 2,
        "door_id in (1, 3, 4000000000)": lambda e: e.get("door_id") in {1, 3},
        "door_id = 77777": lambda _: False,
        "door_id is null": lambda e: "door_id" not in e,
        "door_id is not null": lambda e: "door_id" in e,
        "door_name is null and door_id > 1": lambda e: (
            names[e["event"]] is None and e.get("door_id", 0) > 1
        ),
        f"happened >= {instant(late)}": lambda e: us(e["happened_ns"]) >= late,
        f"happened < {instant(early)}": lambda e: us(e["happened_ns"]) < early,
        f"happened_ns > {late * 1000}": lambda e: e["happened_ns"] > late * 1000,
        f"recorded_ns = {middle['recorded_ns']}": lambda e: e["event"] == middle["event"],
        f"recorded <= {instant(us(middle['recorded_ns']))}": lambda e: (
            us(e["recorded_ns"]) <= us(middle["recorded_ns"])
        ),
        f"event between 20 and {middle['event']}": lambda e: 20 <= e["event"] <= middle["event"],
        "event in (3, 90, 1000000)": lambda e: e["event"] in {3, 90},
        "not retracted and state = 'OPEN'": lambda e: (
            not e["retracted"] and e.get("state") == "OPEN"
        ),
        f"door_id = 1 or event > {middle['event']}": lambda e: (
            e.get("door_id") == 1 or e["event"] > middle["event"]
        ),
        f"kind = 'DoorObserved' and door_id = 1 and happened > {instant(early)}": lambda e: (
            e["kind"] == "DoorObserved" and e.get("door_id") == 1 and us(e["happened_ns"]) > early
        ),
    }
    for name in sorted(filter(None, set(names.values()))):
        cases[f"door_name = '{name}'"] = lambda e, name=name: names[e["event"]] == name
    for condition, passes in cases.items():
        expected = [e["event"] for e in events if passes(e)]
        found = [n for (n,) in rows(log, f"select event from events where {condition} order by 1")]
        assert expected == found, condition


def test_doors(asked: Asked) -> None:
    """The doors now, at a moment, and as they were known at one."""
    log, events = asked
    now = max(e["happened_ns"] for e in events)
    half = events[len(events) // 2]
    at_ns, known = half["happened_ns"], half
    counting = [e for e in events if not e["retracted"]]
    cases = {
        "doors": [e for e in counting if e["happened_ns"] <= now],
        f"doors_at('@{at_ns}')": [e for e in counting if e["happened_ns"] <= at_ns],
        f"doors_at('event:{known['event']}')": plain.known_by(events, known["event"]),
        f"doors_known_at('@{known['recorded_ns']}')": plain.known_by(
            events, known.get("commit", [0, known["event"]])[1]
        ),
        "doors_at('1971-01-01')": [],
    }
    for view, counts in cases.items():
        expected = [
            (door, held.get("text name") or None, *(held.get(f) for f in plain.FIELDS),
             us(held["last_seen"]))
            for door, held in sorted(plain.doors_of(counts).items())
        ]  # fmt: skip
        found = rows(
            log,
            f"select door_id, name, {', '.join(plain.FIELDS)}, epoch_us(last_seen) from {view} "
            "order by door_id",
        )
        assert expected == found, view


def test_intervals(asked: Asked) -> None:
    """Each state's span, of removed doors, too; retracted events do not count."""
    log, events = asked
    end_ns = max(e["happened_ns"] for e in events)
    counting = [e for e in events if not e["retracted"]]
    spans = plain.intervals_of(counting, end_ns)
    expected = [(d, us(since), us(until), state, (until - since) / 1e9)
                for d, since, until, state in spans]  # fmt: skip
    select = "select door_id, epoch_us(since), epoch_us(until), state, seconds from intervals"

    assert expected == rows(log, f"{select} order by 1, 2, 3")
    assert [row for row in expected if row[0] == 2] == rows(log, f"{select} where door_id = 2")


def test_changes(asked: Asked) -> None:
    """What each event changed as the log knew its doors when it was recorded."""
    log, events = asked
    text = {None: None}
    expected = {
        (event, door, field, *(text.get(v, str(v)) for v in (before, after)))
        for event, door, field, before, after in plain.changes_of(events)
    }
    expected = {row for row in expected if row[4] is not None or row[3] is not None}

    found = rows(log, "select event, door_id, field, before, after from changes")

    assert len(found) == len(set(found))
    assert expected == set(found)
    some = rows(log, "select event, door_id, field, before, after from changes where door_id = 2")
    assert {row for row in expected if row[1] == 2} == set(some)


def test_commits(asked: Asked) -> None:
    """Each commit once, with its note."""
    log, events = asked
    expected = {
        (*e.get("commit", [e["event"]] * 2), e.get("actor"), e.get("reason"), e["command_id"])
        for e in events
    }

    found = rows(log, "select first_event, last_event, actor, reason, command_id from commits")

    assert sorted(expected) == found
    assert [(len(events),)] == rows(log, "select sum(events) from commits")
    assert [(len(found),)] == rows(log, "select count(distinct hash) from commits")


def test_patrols(asked: Asked) -> None:
    """Rounds with their first start and end."""
    log, events = asked
    ends: dict[tuple[int, str], int] = {}
    for event in events:
        if event["kind"].startswith("Patrol") and not event["retracted"]:
            ends.setdefault((event["patrol"], event["kind"]), event["happened_ns"])
    expected = [
        (n, us(ends.get((n, "PatrolStarted"))), us(ends.get((n, "PatrolFinished"))))
        for n in sorted({number for number, _ in ends})
    ]

    found = rows(
        log, "select patrol, epoch_us(since), epoch_us(until) from patrols order by patrol"
    )

    assert expected == found


def test_poses(asked: Asked) -> None:
    """Where the robot was, without what was taken back."""
    log, events = asked
    expected = [
        (e["event"], us(e["happened_ns"]), e["level"], e["x"], e["y"], e.get("sd_xy"))
        for e in events
        if e["kind"] == "RobotPose" and not e["retracted"]
    ]

    found = rows(log, "select event, epoch_us(happened), level, x, y, sd_xy from poses order by 1")
    some = rows(log, "select event from poses where event > 100 order by 1")

    assert expected == found
    assert [(row[0],) for row in expected if row[0] > 100] == some


def test_beliefs(asked: Asked) -> None:
    """What `probabilities` says, now and at a moment, and some time ahead."""
    log, events = asked
    half = events[len(events) // 2]["happened_ns"]
    cases: dict[str, dict[str, Any]] = {
        "beliefs()": {}, "beliefs('now')": {"at": "now"}, f"beliefs('@{half}')": {"at": half},
        "beliefs('1h ago', '2h')": {"at": "1h ago", "horizon_ns": 2 * 3600 * 10**9},
    }  # fmt: skip
    for view, asked_as in cases.items():
        expected = [
            (b.door.door_id, b.p_open, b.low, b.high, b.is_known, us(b.time_ns))
            for b in probabilities(log, **asked_as)
        ]
        found = rows(log, f"select door_id, p_open, low, high, known, epoch_us(moment) from {view}")
        assert expected == found, view


def test_the_same_after_the_tables_are_gone(asked: Asked) -> None:
    """Removing the read model loses nothing, also while the log is open."""
    log, events = asked
    before = rows(log, "select event, state, door_name from events order by event")
    shutil.rmtree(log.path / "index", ignore_errors=True)

    assert before == rows(log, "select event, state, door_name from events order by event")
    assert len(events) == len(before)
