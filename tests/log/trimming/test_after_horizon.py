"""A log whose oldest events are no longer kept answers from its horizon on, as the whole log does.

What names no beginning begins there, and warns once; what begins or ends earlier is refused.
"""

from __future__ import annotations

import json
import re
import shutil
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.explanation import Explanation
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.folds.projection import Projection
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import (
    FloorMap,
    LevelAdded,
    PatrolFinished,
    PatrolStarted,
    RobotPose,
)
from semmap_log.errors import HorizonError, HorizonWarning
from semmap_log.log.replay.read_model.indexing import index
from semmap_log.log.replay.state import state_at
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.rerun.recording import save_rrd
from tests.log.trimming.logs import MinuteClock
from tests.verbs import ran as semmap

SECOND_NS = 10**9
DAY_NS = 86_400 * SECOND_NS
LATE_S = {30: 30, 32: 25 * 60}
"""Rounds whose report of a door is so late; the second one tells of before the horizon."""


class Logs(NamedTuple):
    """A log, and the same without what is older than its middle."""

    whole: Path
    kept: Path
    horizon_ns: int
    end_ns: int
    """After the whole log's last event, and before the trimming of the other."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    whole, clock = tmp_path_factory.mktemp("whole") / "log", MinuteClock()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", 10)
        with sl.create(whole, tz="UTC", clock=clock, compact=False) as log:
            _write(log, clock)
    kept = Path(shutil.copytree(whole, tmp_path_factory.mktemp("kept") / "log"))
    middle, end_ns = LogReader(whole).segments[6], clock.now_ns + 1
    clock.now_ns += DAY_NS
    trim_log(kept, Retention(LogReader(kept), middle.recorded[0]), writing={"clock": clock})
    assert 0 < LogReader(kept).horizon <= middle.header.first_event
    return Logs(whole, kept, LogReader(kept).horizon_ns, end_ns)


def test_without_keyframes_there_is_no_state(logs: Logs) -> None:
    """It would lack what is gone."""
    with pytest.raises(HorizonError):
        state_at(LogReader(logs.kept), uses_keyframes=False)


def _write(log: sl.DoorLogWriter, clock: MinuteClock) -> None:
    """Two levels and three doors, one of which moves up early; rounds, poses, late reports."""
    cells = np.zeros((20, 20), np.int8)
    plan: dict[str, Any] = {"resolution": 0.5, "origin_x": 0.0, "origin_y": 0.0, "cells": cells}
    log.append([LevelAdded(level=1, name="EG"), LevelAdded(level=2, name="OG")])
    log.append([FloorMap(level=level, **plan) for level in (1, 2)])
    doors = [
        log.add_door(x=float(i), y=2.0, theta=0.0, width=0.9, name=name, level=1)
        for i, name in enumerate(["front", "back", "lift"], start=1)
    ]
    log.update_door(doors[2], x=5.0, y=5.0, theta=1.0, width=1.0, level=2)
    for i in range(40):
        clock.now_ns += 60 * SECOND_NS
        late_ns = clock.now_ns - LATE_S.get(i, 0) * SECOND_NS
        log.append([PatrolStarted(patrol=i), RobotPose(x=1 + i / 10, y=1.0, theta=0.0, level=1)])
        at = f"@{late_ns}" if i in LATE_S else None
        log.observe(doors[i % 3], "closed" if i % 5 < 2 else "open", accuracy=0.9, at=at)
        log.append([PatrolFinished(patrol=i)])


def test_the_first_event_is_before_the_horizon_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 3)
    clock = MinuteClock()
    with sl.create(tmp_path / "log", tz="UTC", clock=clock, compact=False) as log:
        for i in range(12):
            clock.now_ns += 60 * SECOND_NS
            log.append([RobotPose(x=float(i), y=1.0, theta=0.0)])
    middle = LogReader(tmp_path / "log").segments[2].recorded[0]
    trim_log(tmp_path / "log", Retention(LogReader(tmp_path / "log"), middle))

    with pytest.raises(HorizonError):
        sl.read(tmp_path / "log").entry(0)


def page_of(path: Path) -> Any:
    """Return what a page shows, but for what is learnt of all sightings, and of the files."""
    found = re.search(r'type="application/json"[^>]*>(.*?)</script>', path.read_text(), re.DOTALL)
    assert found
    data = json.loads(found[1])
    return {
        **{key: value for key, value in data.items() if key != "health"},
        "doors": [{k: v for k, v in door.items() if k not in ("p", "week")} for door in
                  data["doors"]],
    }  # fmt: skip


def contents_of(path: Path) -> Any:
    """Return what was written, so that it can be compared."""
    if path.is_dir():
        return {each.name: each.read_bytes() for each in sorted(path.iterdir())}
    return page_of(path) if path.suffix == ".html" else path.read_bytes()


VIEWS = {
    "report": (["report", "LOG", "OUT/x.html"], 1),
    "mcap": (["export", "LOG", "OUT/x.mcap"], 0),
    "rosbag2": (["export", "LOG", "OUT/x"], 0),
    "rosbag": (["export", "LOG", "OUT/x.bag"], 0),
    "markers": (["export", "LOG", "OUT/x.mcap", "--markers"], 0),
    "pseudonymous": (["export", "LOG", "OUT/x.mcap", "--pseudonymous", "--with-tracks"], 0),
    "costmap": (["costmap", "LOG", "OUT/x.mcap", "--level", "EG"], 0),
}
"""What each verb is given, and how long after the horizon the first event is that it shows, ns."""


@pytest.mark.parametrize("view", VIEWS)
def test_a_view_begins_at_the_horizon_as_one_of_the_whole_log_that_begins_there(
    logs: Logs,
    view: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The state of the horizon opens it. Only where no beginning is asked for a line says so."""
    said, found = [], []
    asked, after = VIEWS[view]
    since = ["--since", f"@{logs.horizon_ns + after}"]
    for name, log, more in (
        ("kept", logs.kept, []),
        ("since", logs.kept, since),
        ("whole", logs.whole, since),
    ):
        out = tmp_path / name
        out.mkdir()
        given = [each.replace("LOG", str(log)).replace("OUT", str(out)) for each in asked]
        code, _, err = semmap(capsys, *given, *more, "--until", f"@{logs.end_ns}")
        assert code == 0, err
        said.append(err.count("what was before is no longer kept."))
        assert "/semmap-log-" not in err
        found.append(contents_of(next(out.glob("x*"))))

    assert found[0] == found[1] == found[2]
    assert said == [1, said[1], 0]


@pytest.mark.viewer
def test_a_recording_begins_at_the_horizon(logs: Logs, tmp_path: Path) -> None:
    """At each moment of each timeline it shows what one of the whole log shows."""
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    from tests.views.rerun.some_logs import Drawn

    span: dict[str, Any] = {"until": f"@{logs.end_ns}", "beliefs": False}
    with pytest.warns(HorizonWarning):
        save_rrd(sl.read(logs.kept), tmp_path / "kept.rrd", **span)
    save_rrd(sl.read(logs.whole), tmp_path / "whole.rrd", since=f"@{logs.horizon_ns + 1}", **span)

    one, other = Drawn(tmp_path / "kept.rrd"), Drawn(tmp_path / "whole.rrd")
    assert one.shows() == other.shows()
    assert one.statics.keys() == other.statics.keys()
    assert "/map/EG/doors/front" in one.entities


def test_which_level_the_robot_is_on_is_looked_for_behind_the_horizon(
    logs: Logs, tmp_path: Path
) -> None:
    """Though a day before the moment is further back; a moment before the horizon is refused."""
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    shown: dict[str, Any] = {"beliefs": False, "costmap": False, "since": f"@{logs.horizon_ns + 1}"}

    save_rrd(
        sl.read(logs.kept), tmp_path / "x.rrd", at=f"@{logs.horizon_ns + 120 * SECOND_NS}", **shown
    )

    with pytest.raises(HorizonError):
        save_rrd(sl.read(logs.kept), tmp_path / "x.rrd", at=f"@{logs.horizon_ns - 1}", **shown)


EARLIER = {
    "view": ["view", "LOG", "--save", "OUT/x.rrd", "--since"],
    "view until": ["view", "LOG", "--save", "OUT/x.rrd", "--until"],
    "report": ["report", "LOG", "OUT/x.html", "--since"],
    "report until": ["report", "LOG", "OUT/x.html", "--until"],
    "bag": ["export", "LOG", "OUT/x.mcap", "--since"],
    "bag until": ["export", "LOG", "OUT/x.mcap", "--until"],
    "pseudonymous": ["export", "LOG", "OUT/x.bag", "--pseudonymous", "--since"],
    "pseudonymous until": ["export", "LOG", "OUT/x.bag", "--pseudonymous", "--until"],
    "costmap": ["costmap", "LOG", "OUT/x.mcap", "--level", "EG", "--since"],
    "costmap until": ["costmap", "LOG", "OUT/x.mcap", "--level", "EG", "--until"],
    "timeline": ["timeline", "LOG", "front", "--since"],
    "timeline until": ["timeline", "LOG", "front", "--until"],
    "history": ["history", "LOG", "--since"],
    "replay": ["replay", "LOG", "--at"],
    "why": ["why", "LOG", "front", "--at"],
}


@pytest.mark.parametrize("asked", EARLIER)
def test_what_begins_or_ends_before_the_horizon_is_refused(
    logs: Logs, asked: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In one line that says when the log's history begins; nothing is written."""
    given = [each.replace("LOG", str(logs.kept)).replace("OUT", str(tmp_path)) for each in
             EARLIER[asked]]  # fmt: skip

    code, out, err = semmap(capsys, *given, f"@{logs.horizon_ns - 60 * SECOND_NS}")

    assert (code, out) == (1, "")
    assert "history begins at event" in err.splitlines()[-1]
    assert "ask about a later moment" in err.splitlines()[-1]
    assert "/semmap-log-" not in err
    assert not list(tmp_path.iterdir())


AT_HORIZON: dict[str, Callable[[sl.DoorLog, str, str], Any]] = {
    "replay": lambda log, at, _: doors_of(log.replay(at=at)),
    "replay as known": lambda log, at, _: doors_of(log.replay(known_at=at)),
    "diff": lambda log, at, end: [entry.number for entry in log.diff(at, end).events],
    "why": lambda log, at, _: states_of(log.why("lift", at=at)),
    "timeline": lambda log, at, end: [
        (door, one.start_ns, one.state)
        for door, line in log.timelines(since=at, until=end).items()
        for one in line
    ],
    "history": lambda log, at, end: [entry.number for entry in log.history(None, at, end)],
    "recorded": lambda log, at, end: [
        entry.number for entry in log.history(None, at, end, recorded=True)
    ],
    "excerpt": lambda log, at, end: doors_of(Excerpt.of(log, at, end, None).before()),
    "excerpt as known": lambda log, at, end: Excerpt.of(log, at, end, None).number_before(),
}
"""What is asked of a log at a moment, and up to a later one."""


def doors_of(doors: sl.DoorMap) -> list[tuple[int, sl.DoorState, int | None]]:
    """Return the doors, how each is, and since when it is known."""
    return [(i, door.state, door.last_seen_ns) for i, door in doors.doors.items()]


def states_of(why: Explanation) -> tuple[Any, ...]:
    """Return what was true, what was believed, and what came next."""
    return why.true.state, why.believed.state, why.next and why.next.entry.number


@pytest.mark.parametrize("asked", AT_HORIZON)
def test_the_moment_of_the_horizon_itself_is_answered(logs: Logs, asked: str) -> None:
    """
    As the whole log does: the keyframe there is the state of it. Just before it is refused.
    """
    at, end = f"@{logs.horizon_ns}", f"@{logs.end_ns}"

    found = AT_HORIZON[asked](sl.read(logs.kept), at, end)

    assert found == AT_HORIZON[asked](sl.read(logs.whole), at, end)
    assert found
    with pytest.raises(HorizonError):
        AT_HORIZON[asked](sl.read(logs.kept), f"@{logs.horizon_ns - 1}", end)


FILTERS: dict[str, Callable[[HistoryEntry], bool]] = {
    "true": lambda _: True,
    "event < 30": lambda entry: entry.number < 30,
    "event > 5": lambda entry: entry.number > 5,
    "happened_ns > 1700000100000000000": lambda entry: entry.folds_ns > 1700000100000000000,
    "kind = 'RobotPose'": lambda entry: entry.kind == "RobotPose",
    "door_name = 'lift'": lambda entry: entry.door_id == 3,
}


@pytest.mark.parametrize("having", FILTERS)
@pytest.mark.parametrize("has_index", [False, True])
def test_a_query_is_about_what_is_kept(
    logs: Logs, having: str, tmp_path: Path, has_index: bool
) -> None:
    """Whatever it filters by, and with an index, too."""
    pytest.importorskip("duckdb", reason="DuckDB is not installed")
    log = Path(shutil.copytree(logs.kept, tmp_path / "log"))
    if has_index:
        index(log)
    with pytest.warns(HorizonWarning):
        expected = [one.number for one in sl.read(log).history() if FILTERS[having](one)]

    opened = sl.read(log)
    with pytest.warns(HorizonWarning):
        found = opened.sql(f"select event from events where {having} order by event").fetchall()

    assert [number for (number,) in found] == expected
    assert len(expected) > 5


def test_the_level_of_a_door_that_moved_before_the_horizon_is_where_it_is(logs: Logs) -> None:
    """As a column of the events about it: the update that moved it is gone."""
    span: dict[str, Any] = {"since": f"@{logs.horizon_ns + 1}", "until": f"@{logs.end_ns}"}
    with warnings.catch_warnings():
        warnings.simplefilter("error", HorizonWarning)
        found = sl.read(logs.kept).to_arrow(**span)

    assert found.equals(sl.read(logs.whole).to_arrow(**span))
    assert found.filter(pc.field("door_name") == "lift")["level_name"].to_pylist()[0] == "OG"


class Told(Projection[list[tuple[int, int]]]):
    """What happened when, as it was taken in."""

    name, version = "Told", 1

    def initial(self) -> list[tuple[int, int]]:
        return []

    def apply(self, state: list[tuple[int, int]], batch: EventBatch) -> list[tuple[int, int]]:
        return [*state, *zip(batch.number.tolist(), batch.folds_ns.tolist(), strict=True)]


@pytest.mark.parametrize("before", [None, 30, "horizon"])
def test_a_fold_with_a_checkpoint_is_that_without(
    logs: Logs, tmp_path: Path, before: int | str | None
) -> None:
    """One that was saved before the trimming and behind which events are gone does not count."""
    checkpoint, opened = tmp_path / "saved", sl.read(logs.kept)
    horizon = opened.horizon()
    if before is not None:
        last = (
            horizon - 1 if before == "horizon" else LogReader(logs.whole).commit_at(30).last_event
        )
        earlier = sl.read(logs.whole).fold(Told(), event=last, checkpoint=checkpoint)
        assert checkpoint.exists()

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = [sl.read(logs.kept).fold(Told(), checkpoint=checkpoint) for _ in range(2)]

    with pytest.warns(HorizonWarning):
        expected = sl.read(logs.kept).fold(Told())
    if before == "horizon":
        expected = [*earlier, *(one for one in expected if one[0] >= horizon)]
    assert found == [expected, expected]
    assert [one.category for one in caught] == ([] if before == "horizon" else [HorizonWarning])
    with pytest.raises(HorizonError):
        sl.read(logs.kept).fold(
            Told(), at=f"@{opened.horizon_ns() - 1}", checkpoint=tmp_path / "other"
        )


def test_a_live_fold_begins_at_the_horizon(logs: Logs) -> None:
    """With what it says of the time before."""
    with pytest.warns(HorizonWarning):
        (found,) = sl.read(logs.kept).fold_live(Told(), stop=lambda: True)

    with pytest.warns(HorizonWarning):
        assert found.state == sl.read(logs.kept).fold(Told())
    assert found.event == sl.read(logs.kept).last_event()


def test_a_fleet_exports_what_is_kept(
    logs: Logs, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of each month, also of those before the horizon."""
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    out = tmp_path / "lake"
    engine = ["--engine", "serial", "--results", tmp_path / "results"]

    code, _, err = semmap(capsys, "fleet", "export", logs.kept, "--out", out, *engine)

    assert code == 0, err
    with pytest.warns(HorizonWarning):
        expected = [one.number for one in sl.read(logs.kept).history()]
    rows = [row for part in out.rglob("*.parquet") for row in
            pq.read_table(part, columns=["event"])["event"].to_pylist()]  # fmt: skip
    assert sorted(rows) == expected


def test_a_join_warns_of_its_own_horizon_alone(logs: Logs, tmp_path: Path) -> None:
    """Its parts say nothing more."""
    with sl.create(tmp_path / "two", tz="UTC", clock=MinuteClock()) as other:
        other.add_door(x=90.0, y=90.0, theta=0.0, width=0.9, name="far", state="closed")

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", HorizonWarning)
        list(sl.join({"one": logs.kept, "two": tmp_path / "two"}).history())

    assert [one.category for one in caught] == [HorizonWarning]


def test_a_copy_without_names_is_not_written_into_the_log(
    logs: Logs, capsys: pytest.CaptureFixture[str]
) -> None:
    """Everything there is the log's, whatever copy is exported."""
    code, _, err = semmap(capsys, "export", logs.kept, logs.kept / "x.html", "--pseudonymous")

    assert code == 1
    assert "lies in the log's own folder" in err
    assert not (logs.kept / "x.html").exists()


@pytest.mark.parametrize("again", [False, True], ids=["once", "twice"])
def test_a_state_that_was_seen_before_the_horizon_holds_as_long_as_in_the_whole_log(
    again: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The event that set it stays, with who saw it; of a set state the same."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 4)
    whole, kept, clock = tmp_path / "whole", tmp_path / "kept", MinuteClock()
    with sl.create(whole, tz="UTC", clock=clock, compact=False) as log:
        doors = [log.add_door(x=float(i), y=1.0, theta=0.0, width=0.9) for i in range(3)]
        for state in ("closed", "open"):
            log.observe(doors[0], state, accuracy=0.9, actor="robot7", reason="round")
            log.update_door(doors[1], state=state)
        for i in range(60):
            clock.now_ns += 600 * SECOND_NS
            log.observe(doors[2], "open" if i % 3 else "closed", accuracy=0.9)
    shutil.copytree(whole, kept)
    for place in [4, 9][: 1 + again]:
        until_ns = LogReader(whole).segments[place].recorded[0]
        trim_log(kept, Retention(LogReader(kept), until_ns), writing={"clock": clock})

    before, after = sl.read(whole), sl.read(kept)
    end_ns, horizon_ns = before.replay().latest_ns, after.horizon_ns()
    assert before.entry(5).event.state == DoorState.OPEN
    # What it was before is gone.
    assert str(after.entry(5)) == str(replace(before.entry(5), changes=()))
    for door in doors[:2]:
        expected = before.timeline(door, at=end_ns).between(horizon_ns)
        found = after.timeline(door, at=end_ns).between(horizon_ns)
        assert (list(found), found.not_seen_since_ns) == (
            list(expected), expected.not_seen_since_ns,
        )  # fmt: skip
    assert after.timeline(doors[0], at=end_ns).not_seen_since_ns is not None
    assert after.timeline(doors[1], at=end_ns).not_seen_since_ns is None
