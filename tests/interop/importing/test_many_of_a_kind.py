"""Files of very many doors, levels, retractions or floor plans: work and memory grow with them."""

from __future__ import annotations

import base64
import json
import tracemalloc
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds import door_index
from semmap_log.core.folds.door_index import DoorIndex
from semmap_log.core.model.doors import Door, DoorId, DoorMap, Level
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorRemoved, DoorUpdated, Event
from semmap_log.core.model.meaning import Changed
from semmap_log.errors import FormatError
from semmap_log.interop.importing import importing_lines
from semmap_log.interop.importing.import_plan import Present, weight_of
from semmap_log.interop.importing.importing_lines import plan_event_lines
from semmap_log.interop.importing.line_commits import LineReader
from semmap_log.log.door_log.known_past import EarlyCounter
from semmap_log.store.reading import live_scan
from tests.interop.importing.nothing_stored import NothingStored, lines_of

NOBODY = Present(DoorMap({}, {}), frozenset())
NAN = float("nan")
PLACE = {"x": 1.0, "y": 2.0, "theta": 0.0, "width": 0.9}


def _written(path: Path, lines: Iterable[dict[str, object]]) -> Path:
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def _doors(*doors: tuple[int, int, str]) -> Present:
    """Return a log's doors: id, level, name; on the levels 1 (L1), 2 (a/b) and 3."""
    levels = {1: Level(1, "L1"), 2: Level(2, "a/b"), 3: Level(3)}
    known = {
        DoorId(i): Door(DoorId(i), level, 0.0, 0.0, 0.0, 1.0, sl.DoorState.OPEN, NAN, NAN,
                        annotations={"name": name})
        for i, level, name in doors
    }  # fmt: skip
    return Present(DoorMap(known, levels), frozenset(known))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("front", 1), ("L1/front", 1), ("a/b/back", 2), ("3/back", 3), ("L1/x/y", 4), ("x/y", 4),
        ("back", "2 doors have the name 'back'"), ("L1/back", "no door has the name 'L1/back'"),
        ("b/back", "no door has the name"), ("", "no door has the name"), ("/", "no door has the"),
        ("/" * 10**6, "no door has the name '///"),
    ],
)  # fmt: skip
def test_a_door_is_found_by_its_name_or_by_level_and_name(
    tmp_path: Path, text: str, expected: int | str
) -> None:
    """Names and levels may have slashes in them."""
    present = _doors((1, 1, "front"), (2, 2, "back"), (3, 3, "back"), (4, 1, "x/y"))
    path = _written(
        tmp_path / "in.jsonl", [{"kind": "DoorObserved", "door": text, "state": "OPEN"}]
    )
    reader = LineReader(path, present, "UTC")

    found = list(reader.lines())

    if isinstance(expected, int):
        assert [expected] == [line.event.door_id for _, line in found]  # type: ignore[attr-defined]
    else:
        with pytest.raises(FormatError, match=expected):
            reader.problems.raise_any()


def test_a_door_that_gets_another_name_is_found_by_that(tmp_path: Path) -> None:
    """And no longer by the old one, nor by none once it is taken back; levels alike."""
    name = {"kind": "DoorAnnotated", "door_id": 1, "key": "name"}
    seen = {"kind": "DoorObserved", "state": "OPEN"}
    pose = {"kind": "RobotPose", "x": 1, "y": 1, "theta": 0}
    lines = [
        name | {"value": "rear"}, seen | {"door": "rear"}, seen | {"door": "front"},
        name | {"value": ""}, seen | {"door": "rear"},
        {"kind": "LevelAdded", "level": 3, "name": "top"}, pose | {"level": "top"},
        pose | {"level": "3"}, pose | {"level": "number:1"}, pose | {"level": "L7"},
    ]  # fmt: skip
    reader = LineReader(_written(tmp_path / "in.jsonl", lines), _doors((1, 1, "front")), "UTC")

    found = dict(reader.lines())

    assert [1, 2, 4, 6, 7, 8, 9] == list(found)
    assert [3, 3, 1] == [found[line].event.level for line in (7, 8, 9)]  # type: ignore[attr-defined]


def test_a_name_is_not_compared_with_those_of_all_doors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor a level's with those of all levels."""
    asked: list[int] = []
    usual = DoorMap.level_name
    monkeypatch.setattr(DoorMap, "level_name", lambda *of: (asked.append(1), usual(*of))[1])
    seen = ({"kind": "DoorObserved", "door": f"d{i}", "state": "OPEN"} for i in range(200))
    present = _doors(*((i, 1, f"d{i}") for i in range(200)))
    reader = LineReader(_written(tmp_path / "in.jsonl", seen), present, "UTC")

    assert 200 == len(list(reader.lines()))
    assert len(asked) < 10


def test_levels_are_counted_on_while_doors_come_and_go(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if all were counted each time, which is done when a level comes or goes."""
    counted: list[int] = []
    usual = door_index.level_numbers
    monkeypatch.setattr(door_index, "level_numbers", lambda *of: (counted.append(1), usual(*of))[1])
    index = DoorIndex.of_map(DoorMap({}, {}), ())
    for number in range(100):
        index.apply(DoorAdded(door_id=DoorId(number), level=number // 50, **PLACE), number)
        index.apply(DoorAdded(door_id=DoorId(1000 + number), level=7), number)
        assert list(index.levels) == [0, 1][: 1 + number // 50]
    assert len(counted) <= 3

    moves = {"changed": Changed.POSE, "x": 0.0, "y": 0.0, "theta": 0.0}
    for number in range(50, 100):
        index.apply(DoorUpdated(door_id=DoorId(number), level=2, **moves), number)  # type: ignore[arg-type]
        assert list(index.levels) == ([0, 1, 2] if number < 99 else [0, 2])
    for number in range(50):
        index.apply(DoorRemoved(door_id=DoorId(number)), number)
        assert list(index.levels) == ([0, 2] if number < 49 else [2])
    index.bring_back(3)
    assert [0, 2] == list(index.levels)
    assert len(counted) < 12


class _NotAll(dict[int, int]):
    """Doors that are not to be gone through."""

    def values(self) -> object:  # type: ignore[override]
        raise AssertionError("all doors are gone through for a few rows")

    items = values  # type: ignore[assignment]


def test_a_few_rows_are_compared_with_their_own_doors_alone() -> None:
    """However many doors there are."""
    counter = EarlyCounter(None)
    rows = EventBatch.of(DoorObserved, door_id=[5, 7, 9_999_999], happened_ns=[10, 10, 10], state=1)

    counter.note_rows(rows, _NotAll({i: 9 + i % 5 for i in range(1000)}))

    assert {7: 1} == counter.found.counts


class _Counting(NothingStored):
    def __init__(self) -> None:
        self.looks = 0

    def comings(self, first: int, last: int) -> Iterator[Event]:
        self.looks += 1
        return super().comings(first, last)


def test_what_was_retracted_is_looked_up_once(tmp_path: Path) -> None:
    """Not again for each retraction that follows."""
    lines: list[dict[str, object]] = []
    for number in range(0, 200, 2):
        added = {"kind": "DoorAdded", "door_id": number + 1}
        back = {"kind": "Retracted", "first_event": number, "last_event": number}
        lines += [
            line | {"event": n, "command_id": f"{n:032x}"}
            for n, line in ((number, added), (number + 1, back))
        ]
    stored = _Counting()
    path = _written(tmp_path / "in.jsonl", lines)

    plan = plan_event_lines(path, NOBODY, lines_of("UTC"), stored, now_ns=10**18)

    assert 200 == plan.count
    assert stored.looks <= 100


def test_a_writer_does_not_read_its_log_again_for_each_retraction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only what was written since the last one."""
    scans: list[int] = []
    usual = live_scan.scan_live
    monkeypatch.setattr(live_scan, "scan_live", lambda *of: (scans.append(1), usual(*of))[1])
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for _ in range(20):
            door = log.add_door()
            log.retract(log.last_event())
            assert door not in log.door_map().doors

    assert len(scans) <= 4


def test_floor_plans_are_not_all_kept_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of twenty with a million cells each, a few kilobytes a line."""
    cells = base64.b64encode(zlib.compress(bytes(10**6))).decode()
    line = {"kind": "FloorMap", "resolution": 0.05, "origin_x": 0, "origin_y": 0, "width": 1000,
            "height": 1000, "cells_zlib_base64": cells}  # fmt: skip
    path = _written(tmp_path / "in.jsonl", [{**line, "level": level} for level in range(20)])
    monkeypatch.setattr(importing_lines, "MOST_KEPT", 8_000)
    tracemalloc.start()

    plan = plan_event_lines(path, NOBODY, lines_of("UTC"), NothingStored(), now_ns=10**18)

    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 20 == plan.count
    assert peak < 6 * 10**6
    events = [one.event for commit in plan.commits() for _, one in commit.lines]
    assert [10**6 // 256 + 1] * 20 == list(map(weight_of, events))
