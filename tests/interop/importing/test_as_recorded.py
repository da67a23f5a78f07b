"""Imported history as believed history: a file's times are when it was known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.core.model.moments import Moment
from semmap_log.errors import FormatError
from semmap_log.interop.importing import as_recorded
from semmap_log.interop.importing.import_plan import Imported
from semmap_log.interop.importing.importing import ImportOptions, import_file
from tests.interop.formats.bags.bags_of_others import Said, write_mcap
from tests.interop.topics.robots import START, Robot, S

NOW_NS = 1_780_000_000 * 10**9
SEEN = {"kind": "DoorObserved", "door_id": 1, "state": "OPEN"}
ADDED = {"kind": "DoorAdded", "door_id": 1, "level": 0}


@pytest.fixture
def log(tmp_path: Path) -> Any:
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(NOW_NS)) as made:
        yield made


def _csv(path: Path, *rows: str) -> Path:
    path.write_text("timestamp,door,state\n" + "".join(f"2026-03-{row}\n" for row in rows))
    return path


def _lines(path: Path, *lines: dict[str, Any]) -> Path:
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def _take(log: sl.DoorLogWriter, path: Path, **options: Any) -> Imported:
    options = {"as_recorded": True, "new_doors": True} | options
    return import_file(log, path, ImportOptions(**options))


def _known(log: sl.DoorLog, at: str) -> dict[str | None, str]:
    """Return what was known of each door at a moment."""
    return {door.name: door.state.name for door in log.replay(known_at=at).doors.values()}


@pytest.mark.parametrize("is_in_order", [True, False])
def test_what_was_known_at_a_moment_can_be_asked_of_a_csv(
    log: sl.DoorLogWriter, tmp_path: Path, *, is_in_order: bool
) -> None:
    """Each time of the file is a commit, at that moment; what follows comes after it."""
    rows = ["01T10:00,a,open", "01T11:00,a,closed", "01T11:00,b,open", "01T12:00,b,closed"]
    if not is_in_order:
        rows = [rows[0], rows[1], rows[3].replace("b", "c"), rows[2]]
    _take(log, _csv(tmp_path / "a.csv", *rows))
    _take(log, _csv(tmp_path / "b.csv", "02T10:00,a,open"))

    other = "c" if not is_in_order else "b"
    assert {} == _known(log, "2026-03-01T09:59:59")
    assert {"a": "OPEN"} == _known(log, "2026-03-01T10:00")
    assert {"a": "CLOSED", "b": "OPEN"} == _known(log, "2026-03-01T11:00")
    assert "CLOSED" == _known(log, "2026-03-01T12:00")[other]
    assert "OPEN" == _known(log, "2026-03-02T10:00")["a"]
    assert 4 == len(list(log.commits()))


def test_plans_and_bags_can_be_known_then(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """Doors of a database since a day; a bag's messages when they came."""
    doors = tmp_path / "doors.yaml"
    doors.write_text("1: {position: {x: 0, y: 0, theta: 0}, width: 1}")
    since_ns = START - 86_400 * S
    _take(log, doors, since_ns=since_ns, at_ns=since_ns)
    write_mcap(tmp_path / "day.mcap", [Said("/s", *Robot().door_state("gate", 2), START)])
    _take(log, tmp_path / "day.mcap")

    assert [1, 2] == [len(log.replay(known_at=Moment(ns=ns)).doors) for ns in (since_ns, START)]
    (tmp_path / "more.yaml").write_text("9: {position: {x: 0, y: 0, theta: 0}, width: 1}")
    with pytest.raises(FormatError, match="expected a time of each event; this file says none"):
        _take(log, tmp_path / "more.yaml")


def test_files_since_the_same_time_are_known_one_after_the_other(
    log: sl.DoorLogWriter, tmp_path: Path
) -> None:
    """Nanoseconds apart, since recorded times grow: one for each event, and one for the commit."""
    for number in (1, 2, 3):
        doors = tmp_path / f"doors{number}.yaml"
        doors.write_text(f"{number}: {{position: {{x: 0, y: 0, theta: 0}}, width: 1}}")
        _take(log, doors, since_ns=START, at_ns=START)

    times = [commit.recorded_ns for commit in log.commits()]
    assert START == times[0] < times[1] < times[2] < START + 10
    known = [len(log.replay(known_at=Moment(ns=ns)).doors) for ns in (*times, START + 10)]
    assert [1, 2, 3, 3] == known
    assert 3 == len(log.replay(at=Moment(ns=START)).doors)


def test_where_the_logs_order_does_not_allow_it_it_is_refused(
    log: sl.DoorLogWriter, tmp_path: Path
) -> None:
    """Recorded times only grow, and end now."""
    log.add_door(name="a")

    with pytest.raises(FormatError, match=r"last commit, 2026-05-28 .*03-01"):
        _take(log, _csv(tmp_path / "a.csv", "01T10:00,a,open"))
    (tmp_path / "b.csv").write_text("timestamp,door,state\n2027-01-01,a,open\n")
    with pytest.raises(FormatError, match="now, got 2027-01-01"):
        _take(log, tmp_path / "b.csv")


def test_an_import_that_was_interrupted_goes_on(
    log: sl.DoorLogWriter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was written is held; the same file is then known."""
    path = _csv(tmp_path / "a.csv", *(f"{day:02}T10:00,a,open" for day in range(1, 9)))
    ids = as_recorded._id_at
    calls: list[int] = []

    def fails(file_id: bytes, at_ns: int) -> bytes:
        calls.append(at_ns)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return ids(file_id, at_ns)

    monkeypatch.setattr(as_recorded, "_id_at", fails)
    with pytest.raises(KeyboardInterrupt):
        _take(log, path)
    monkeypatch.undo()
    assert 5 == log.last_event() + 1

    _take(log, path)

    assert 10 == log.last_event() + 1
    assert _take(log, path).known_before


def test_lines_are_recorded_when_they_happened(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """Those that do not say when they were recorded; those of one moment are one commit."""
    path = _lines(
        tmp_path / "a.jsonl", ADDED | {"happened": "2026-03-01T09:00"},
        *(SEEN | {"happened": f"2026-03-01T{at}"} for at in ("10:00", "10:00", "11:00")),
    )  # fmt: skip

    _take(log, path)

    assert [1, 2, 1] == [commit.count for commit in log.commits()]
    assert 1 == len(log.replay(known_at="2026-03-01T09:00").doors)


@pytest.mark.parametrize(
    ("times", "why"),
    [
        (["09:00", "10:00", "10:00"], "line 3 was recorded at .* 10:00.*, not after line 2"),
        (["09:00", None, "10:00"], "line 2 does not say when it was recorded"),
        (["09:00", "08:00", "10:00"], "line 2 was recorded at .* 08:00:00.*, not after line 1"),
        (["2027-01-01", "10:00", "11:00"], "line 1 was recorded at 2027.*, which is to come"),
    ],
)  # fmt: skip
def test_recorded_times_that_cannot_be_kept_are_named_by_their_line(
    log: sl.DoorLogWriter, tmp_path: Path, times: list[str | None], why: str
) -> None:
    """They are recorded now, and a word says why; asked to keep them, it refuses."""
    told = [
        {} if at is None else {"recorded": at if len(at) > 5 else f"2026-03-01T{at}"}
        for at in times
    ]
    path = _lines(tmp_path / "a.jsonl", ADDED | told[0], SEEN | told[1], SEEN | told[2])

    with pytest.raises(FormatError, match=f"--as-recorded: {why}"):
        _take(log, path)
    (said,) = [t for t in _take(log, path, as_recorded=False).plan.summary if "recorded: " in t]
    assert said.startswith("recorded: now, since line ")


def test_lines_follow_what_the_log_has(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """If they are later; without being asked, a log with events of its own does not keep them."""
    _take(log, _csv(tmp_path / "a.csv", "01T10:00,a,open"))
    later = [SEEN | {"recorded": f"2026-03-02T{at}"} for at in ("10:00", "11:00")]
    _take(log, _lines(tmp_path / "a.jsonl", *later))
    assert 1 == len(log.replay(known_at="2026-03-02T10:00").doors)
    assert [1, 1, 1] == [c.recorded_ns < NOW_NS - 10**9 for c in log.commits()]

    with pytest.raises(FormatError, match=r"line 1"):
        _take(log, _lines(tmp_path / "b.jsonl", SEEN | {"recorded": "2026-03-02T10:30"}))
    found = _take(
        log, _lines(tmp_path / "c.jsonl", SEEN | {"recorded": "2026-03-03T10:30"}),
        as_recorded=False,
    )  # fmt: skip
    assert "now, since the log has events of its own" in found.plan.summary[-1]
