"""Which level is meant: the one rule, and all the ways by which something gets on a level."""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.levels import level_shown, levels_of, resolve_level
from semmap_log.core.model.doors import LEVEL_NOT_GIVEN, DoorId, DoorState, is_given
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorUpdated,
    FloorMap,
    LevelAdded,
    RobotPose,
)
from semmap_log.errors import (
    CommandError,
    InvalidEventError,
    LevelNameWarning,
    UnknownLevelError,
)
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.live.ros.line_recorder import LineAnswer, LineRecorder

PLACE = {"x": 1.0, "y": 2.0, "theta": 0.0, "width": 0.9}
POSE = {"x": 1.0, "y": 2.0, "theta": 0.0}
START = 1_772_400_000 * 10**9
SEVERAL = r"several levels: 1 \(L1\), 2 \(L2\); say which one: --level L"


def new_log(path: Path, *names: str) -> sl.DoorLogWriter:
    """Return a new log with these levels, numbered from 1 on."""
    log = sl.create(path / "log", tz="UTC", clock=SteadyClock(START))
    if names:
        log.append([LevelAdded(level=n, name=name) for n, name in enumerate(names, start=1)])
    return log


def levels_in(log: sl.DoorLog) -> list[int]:
    """Return the level of each door, pose and floor map, in the order of the events."""
    kinds = (DoorAdded, RobotPose, FloorMap)
    told = [row.event for batch in log.batches(kinds=kinds) for row in batch]
    return [event.level for event in told if isinstance(event, kinds)]


def floor(**level: int) -> FloorMap:
    return FloorMap(
        **level, resolution=0.5, origin_x=0.0, origin_y=0.0, cells=np.zeros((2, 2), np.int8)
    )


WAYS: dict[str, Callable[[sl.DoorLogWriter], object]] = {
    "add_door": lambda log: log.add_door(**PLACE),
    "add_door without a place": lambda log: log.add_door(name="reed"),
    "a DoorAdded": lambda log: log.append([DoorAdded(door_id=DoorId(1), **PLACE)]),
    "a pose": lambda log: log.append([RobotPose(**POSE)]),
    "a pose among others": lambda log: log.append(
        iter([EventBatch.from_events([RobotPose(**POSE)])])
    ),
    "poses as columns": lambda log: log.append(EventBatch.of(RobotPose, **POSE)),
    "doors as columns": lambda log: log.append(EventBatch.of(DoorAdded, door_id=[1], **PLACE)),
    "a floor map": lambda log: log.append([floor()]),
    "a floor map in a batch": lambda log: log.append(EventBatch.from_events([floor()])),
}


@pytest.mark.parametrize(("names", "level"), [(["L1"], 1), ([], 0)])
@pytest.mark.parametrize("way", WAYS)
def test_the_only_level_is_meant(tmp_path: Path, way: str, names: list[str], level: int) -> None:
    """A building's import calls it 1; before there are any it is 0."""
    with new_log(tmp_path, *names) as log:
        WAYS[way](log)

    assert [level] == levels_in(sl.read(tmp_path / "log"))


@pytest.mark.parametrize("way", WAYS)
def test_of_several_levels_one_must_be_told(tmp_path: Path, way: str) -> None:
    """The message names them, and how to tell; nothing is written."""
    with new_log(tmp_path, "L1", "L2") as log, pytest.raises(UnknownLevelError, match=SEVERAL):
        WAYS[way](log)

    assert [] == levels_in(sl.read(tmp_path / "log"))


@pytest.mark.parametrize("level", [np.int64(2), np.uint8(2), np.int32(2)])
def test_a_number_out_of_an_array_is_a_number(tmp_path: Path, level: int) -> None:
    """As those of a table of pandas or numpy are."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([LevelAdded(level=1, name="L1"), LevelAdded(level=2, name="L2")])
        door = log.add_door(**PLACE, level=level)
        log.robot_pose(RobotPose(**POSE, level=level))

    replayed = sl.read(tmp_path / "log")
    assert 2 == replayed.replay().doors[door].level
    assert [2] == [batch[RobotPose]["level"][0] for batch in replayed.batches(kinds=[RobotPose])]


@pytest.mark.parametrize("level", [2.0, math.nan, np.float64(1), b"L1", True, [1]])
def test_what_is_no_level_is_refused(tmp_path: Path, level: Any) -> None:
    """It is not taken for one that was not told."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([LevelAdded(level=1, name="L1")])
        with pytest.raises(InvalidEventError, match="level: expected a whole number from 0"):
            log.add_door(**PLACE, level=level)


def test_a_name_is_used_once_a_level(tmp_path: Path) -> None:
    """By a door that is added, and by one that gets a name."""
    with new_log(tmp_path, "L1", "L2") as log:
        front = log.add_door(level="L1", name="front")
        other = log.add_door(level="L1")
        log.annotate(front, "name", "front")
        for again in (
            lambda: log.add_door(level="L1", name="front"),
            lambda: log.annotate(other, "name", "front"),
        ):
            with pytest.raises(CommandError, match="door 1 of that level is called 'front'"):
                again()
        log.annotate(log.add_door(level="L2"), "name", "front")


def test_waiting_poses_are_put_on_the_level_at_once(tmp_path: Path) -> None:
    """Not when they are written: who adds a level meanwhile changes nothing."""
    with new_log(tmp_path, "L1") as log:
        log.robot_pose(RobotPose(**POSE))
        log.append([LevelAdded(level=2, name="L2")])
        with pytest.raises(UnknownLevelError, match="several levels"):
            log.robot_pose(RobotPose(**POSE))

    assert [1] == levels_in(sl.read(tmp_path / "log"))


def test_what_comes_before_in_the_same_commit_counts(tmp_path: Path) -> None:
    """Events one by one, and as a batch."""
    events = [LevelAdded(level=3, name="L3"), DoorAdded(door_id=DoorId(1), **PLACE),
              RobotPose(**POSE)]  # fmt: skip
    with new_log(tmp_path) as log:
        log.append(events)
    with new_log(tmp_path / "other") as other:
        other.append(EventBatch.from_events(events))

    assert [3, 3] == levels_in(sl.read(tmp_path / "log"))
    assert [3, 3] == levels_in(sl.read(tmp_path / "other" / "log"))


def test_a_door_stays_on_its_level(tmp_path: Path) -> None:
    """A new position without a level is on the one where the door is, be there several."""
    moved = DoorUpdated(door_id=DoorId(1), changed=Changed.POSE, **POSE)
    assert not is_given(moved.level)
    with new_log(tmp_path, "L1", "L2") as log:
        door = log.add_door(**PLACE, level="L2")
        log.append([moved])
        log.append(EventBatch.from_events([moved]))
        rows = EventBatch.of(DoorUpdated, door_id=1, changed=Changed.POSE, **POSE)
        log.append(rows)

        assert 2 == log.door_map()[door].level
        log.update_door(door, level="L1")
        log.append([moved])

        assert 1 == log.door_map()[door].level


def test_a_late_move_does_not_count_for_what_follows(tmp_path: Path) -> None:
    """A door was put on another level, but before it came to where it is now."""
    with new_log(tmp_path, "L1", "L2") as log:
        door = log.add_door(**PLACE, level=1, at=START - 3)
        log.update_door(door, level=2, x=5.0, at=START - 1)
        log.update_door(door, level=1, x=6.0, at=START - 2)
        log.append([DoorUpdated(door_id=door, changed=Changed.POSE, **POSE)])

        assert 2 == log.door_map()[door].level


def test_levels_are_told_by_name_too(tmp_path: Path) -> None:
    """A name before a number: people see names."""
    with new_log(tmp_path, "0", "1", "attic") as log:
        given = ["1", "attic", 1, "3", "0"]
        doors = [log.add_door(level=level) for level in given]
        found = [log.door_map()[door].level for door in doors]
        with pytest.raises(UnknownLevelError, match=r"no level 'cellar'; there are: 1 \(0\)"):
            log.add_door(level="cellar")

    assert [2, 3, 1, 3, 1] == found


def test_a_name_that_two_levels_bear_means_neither(tmp_path: Path) -> None:
    with new_log(tmp_path, "L", "L") as log:
        said = r"the name of 2 levels: .* number:1 or number:2"
        with pytest.raises(UnknownLevelError, match=said):
            log.add_door(level="L")
        door = log.add_door(level="2")
        assert 2 == log.door_map()[door].level


def test_a_name_that_is_the_number_of_another_level_is_told(tmp_path: Path) -> None:
    """As in a house whose ground floor is called 0, and numbered 1."""
    with new_log(tmp_path, "0", "1") as log:
        with pytest.warns(LevelNameWarning, match=r"name, 2 \(1\); level 1 \(0\) is number:1$"):
            door = log.add_door(level="1")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            others = [log.add_door(level=told) for told in (1, "number:1", "number:2", "0")]
        with pytest.raises(UnknownLevelError, match="no level 'number:3'"):
            log.add_door(level="number:3")

        assert [2, 1, 1, 2, 1] == [log.door_map()[each].level for each in (door, *others)]


def test_doors_with_a_place_make_a_level(tmp_path: Path) -> None:
    """
    Not poses, not doors without one: a log that has those on 0 beside its level 1 has one level.
    """
    with new_log(tmp_path, "L1") as log:
        log.append([RobotPose(level=0, **POSE), DoorAdded(door_id=DoorId(1), level=0)])
        assert [1] == list(levels_of(log.door_map()))
        sensor = log.add_door()
        assert 1 == log.door_map()[sensor].level

        placed = log.add_door(**PLACE, level=0)
        assert [0, 1] == list(levels_of(log.door_map()))
        assert 0 == resolve_level("0", log.door_map())
        with pytest.raises(UnknownLevelError, match=r"several levels: 0, 1 \(L1\)"):
            log.add_door()
        log.remove_door(placed)
        sensor = log.add_door()
        assert 1 == log.door_map()[sensor].level


def test_the_writer_and_a_new_one_mean_the_same(tmp_path: Path) -> None:
    """A log that is opened again, and the one that has just been written."""
    with new_log(tmp_path, "L1") as log:
        door = log.add_door(**PLACE)
        log.update_door(door, level=0, at=START)  # late: the door stays where it is
        first = log.add_door()
    with sl.append(tmp_path / "log") as log:
        second = log.add_door()
        found = log.door_map()

    assert [1, 1] == [found[first].level, found[second].level]


def test_a_command_that_comes_again_is_the_same(tmp_path: Path) -> None:
    """Though the log has more levels by now."""
    command = bytes(range(16))
    events = [DoorAdded(door_id=DoorId(1), **PLACE), RobotPose(**POSE), floor()]
    with new_log(tmp_path, "L1") as log:
        first = log.append(events, command_id=command)
        log.append([LevelAdded(level=2, name="L2")])
        again = log.append(events, command_id=command)

    assert again.repeated
    assert first.first_event == again.first_event


def test_a_batch_marks_what_tells_no_level() -> None:
    """Updates that do not move a door mean none; those of other kinds have none."""
    added = EventBatch.of(DoorAdded, door_id=[1, 2])
    updated = EventBatch.of(DoorUpdated, door_id=[1, 1], changed=[int(Changed.STATE)] * 2, state=1)
    seen = EventBatch.of(DoorObserved, door_id=1, state=int(DoorState.OPEN))
    told = EventBatch.of(DoorAdded, door_id=1, level=0)

    assert [False, False] == [is_given(e.level) for e in added.to_events()]  # type: ignore[attr-defined]
    assert [0, 0] == updated[DoorUpdated]["level"].tolist()
    assert 1 == len(seen)
    assert [True] == [is_given(e.level) for e in told.to_events()]  # type: ignore[attr-defined]
    assert 0 == LEVEL_NOT_GIVEN


# JSON lines


def record(log: sl.DoorLogWriter, *lines: dict[str, object]) -> list[LineAnswer]:
    """Return the answers to lines of JSON."""
    answers: list[LineAnswer] = []
    source, sink = os.pipe()
    with os.fdopen(sink, "w") as file:
        for line in lines:
            file.write(json.dumps(line) + "\n")
    with os.fdopen(source, "rb") as file:
        LineRecorder(log, answers.append).run(file.fileno())
    return sorted(answers, key=lambda answer: answer.line)


LINES: tuple[dict[str, object], ...] = (
    {"kind": "DoorAdded", **PLACE},
    {"kind": "RobotPose", **POSE},
)


@pytest.mark.parametrize("line", LINES, ids=["door", "pose"])
def test_a_line_without_a_level(tmp_path: Path, line: dict[str, object]) -> None:
    """One level: that; several: refused by its own line, which names them; by name or number."""
    with new_log(tmp_path, "L1") as log:
        record(log, line)
        log.append([LevelAdded(level=2, name="L2")])
        refused, *good = record(log, line, {**line, "level": "L2"}, {**line, "level": 1})
        unknown = record(log, {**line, "level": "L7"})

    assert [1, 2, 1] == levels_in(sl.read(tmp_path / "log"))
    assert 1 == refused.line
    assert "several levels: 1 (L1), 2 (L2)" in refused.error
    assert '"level": L in a JSON line' in refused.error
    assert [2, 3] == [answer.line for answer in good if answer.event is not None]
    assert "no level 'L7'; there are: 1 (L1), 2 (L2)." in unknown[0].error


def test_a_pose_that_is_refused_does_not_take_its_neighbours_along(tmp_path: Path) -> None:
    """Poses join the commit of the next line."""
    with new_log(tmp_path, "L1", "L2") as log:
        door = log.add_door(level=1)
        seen = {"kind": "DoorObserved", "door_id": int(door), "state": "OPEN"}
        answers = record(log, {"kind": "RobotPose", **POSE}, seen)

    assert [True, False] == [bool(answer.error) for answer in answers]


def test_levels_of_a_file_of_lines(tmp_path: Path) -> None:
    """As of lines that are recorded; a level that an earlier line added counts."""
    file = tmp_path / "x.jsonl"
    lines = [{"kind": "LevelAdded", "level": 4, "name": "top"}, *LINES,
             {"kind": "RobotPose", "level": "top", **POSE}]  # fmt: skip
    file.write_text("".join(json.dumps(line) + "\n" for line in lines))
    with new_log(tmp_path) as log:
        import_file(log, file)

    assert [4, 4, 4] == levels_in(sl.read(tmp_path / "log"))


def test_an_old_log_comes_back_as_it_was(tmp_path: Path) -> None:
    """Its poses and sensors on level 0, beside a building's levels."""
    from semmap_log.interop.exporting.log_files import export

    with new_log(tmp_path, "L1", "L2") as log:
        log.append([RobotPose(level=0, **POSE), DoorAdded(door_id=DoorId(1), level=0),
                    DoorAdded(door_id=DoorId(2), level=0, **PLACE)])  # fmt: skip
    export(sl.read(tmp_path / "log"), tmp_path / "x.jsonl")
    with new_log(tmp_path / "other") as other:
        import_file(other, tmp_path / "x.jsonl")

    assert [0, 0, 0] == levels_in(sl.read(tmp_path / "other" / "log"))


# Files and pictures


def test_a_door_csv_puts_new_doors_on_the_only_level(tmp_path: Path) -> None:
    """Of several it asks, and names the doors; with the level told it goes on."""
    file = tmp_path / "x.csv"
    file.write_text("timestamp,door,state,accuracy\n2026-03-01T10:00:00Z,reed,open,0.9\n")
    with new_log(tmp_path, "L1", "L2") as log:
        with pytest.raises(UnknownLevelError, match=f"no door is called 'reed'.*{SEVERAL}"):
            import_file(log, file)
        import_file(log, file, ImportOptions(level="L2"))
    with new_log(tmp_path / "other", "L1") as other:
        import_file(other, file)

    assert [2] == levels_in(sl.read(tmp_path / "log"))
    assert [1] == levels_in(sl.read(tmp_path / "other" / "log"))


def test_a_costmap_shows_the_level_with_doors(tmp_path: Path) -> None:
    """Where it is one; else it asks, unless it is told."""
    with new_log(tmp_path, "L1", "L2", "L3") as log:
        with pytest.raises(UnknownLevelError, match="several levels"):
            level_shown(log.door_map())
        log.add_door(**PLACE, level="L2")
        assert 2 == costmap_at(log).level
        log.add_door(**PLACE, level="L3")
        with pytest.raises(UnknownLevelError, match="several levels"):
            costmap_at(log)
        assert 3 == costmap_at(log, CostmapOptions(level="L3")).level


def test_a_floor_map_is_asked_for_like_a_level(tmp_path: Path) -> None:
    """None told: the only one; by name; of several one must be told."""
    with new_log(tmp_path, "L1") as log:
        log.append([floor()])
        assert floor(level=1) == _timeless(log.floor_map())
        assert floor(level=1) == _timeless(log.floor_map("L1"))
        log.append([LevelAdded(level=2, name="L2")])
        with pytest.raises(UnknownLevelError, match="several levels"):
            log.floor_map()


def _timeless(found: FloorMap | None) -> FloorMap | None:
    from dataclasses import replace

    return found and replace(found, happened_ns=None)


def test_an_empty_map_means_level_0() -> None:
    """Also by number; another is none."""
    empty = DoorMapState().door_map()

    assert [0, 0, 0] == [resolve_level(text, empty) for text in (None, 0, "0")]
    with pytest.raises(UnknownLevelError, match="no level 'L1'; there are: 0"):
        resolve_level("L1", empty)


def test_an_update_that_tells_no_level_leaves_the_door_on_its_own(tmp_path: Path) -> None:
    """Though the log has several, so that none would be meant."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([LevelAdded(level=level, name=name) for level, name in [(1, "L1"), (2, "L2")]])
        door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, level="L2")

        log.update_door(door, state="open")
        log.update_door(door, x=3.0)

        assert [2, 2] == [entry.event.level for entry in log.history(kinds=[DoorUpdated])]
        assert (2, 3.0) == (log.door_map()[door].level, log.door_map()[door].x)
