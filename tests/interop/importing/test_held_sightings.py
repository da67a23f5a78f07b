"""Exports that overlap do not count twice, by whichever way in; two sensors are kept apart."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import DoorObserved, DoorUpdated
from semmap_log.interop.formats.files import csv_blocks
from semmap_log.interop.importing import held_sightings
from semmap_log.interop.importing.import_plan import Imported
from semmap_log.interop.importing.importing import ImportOptions, import_file
from tests.interop.formats.bags.bags_of_others import Said, write_mcap
from tests.interop.topics.robots import START, Robot, S

HEADER = "timestamp,door,state,accuracy\n"
ROBOT = Robot()


@pytest.fixture
def log(tmp_path: Path) -> Any:
    with sl.create(tmp_path / "log", tz="UTC") as made:
        yield made


def _csv(path: Path, *rows: str) -> Path:
    path.write_text(HEADER + "".join(f"2026-03-01T{row}\n" for row in rows))
    return path


def _take(log: sl.DoorLogWriter, path: Path, **note: str) -> Imported:
    return import_file(log, path, ImportOptions(new_doors=True), note=Note(**note))


def _count(log: sl.DoorLog) -> int:
    kinds = (DoorObserved, DoorUpdated)
    return sum(len(batch) for batch in log.batches(kinds=kinds))


def test_rows_of_two_exports_are_one_sighting_each(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """Time, door, state and accuracy are the same; another of these is another sighting."""
    _take(log, _csv(tmp_path / "week1.csv", "08:00,gate,OPEN,0.9", "09:00,gate,CLOSED,"))
    week2 = _csv(
        tmp_path / "week2.csv", "08:00,gate,OPEN,0.9", "08:00,gate,OPEN,0.8", "09:00,gate,CLOSED,",
        "09:00,lab,CLOSED,", "10:00,gate,OPEN,",
    )  # fmt: skip

    found = _take(log, week2)

    assert 5 == found.plan.count  # two of them add the lab
    assert "rows: 5; in the log already, by another file: 2" in found.plan.summary
    assert 5 == _count(log)
    assert 0 == _take(log, _csv(tmp_path / "again.csv", "08:00,gate,OPEN,0.9")).plan.count


def test_an_explicit_source_keeps_two_sensors_apart(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """Each with exports that overlap, and files that are alike to the byte."""
    rows = ("08:00,gate,OPEN,0.9", "09:00,gate,CLOSED,0.9")
    for source in ("left", "right", "left"):
        _take(log, _csv(tmp_path / "a.csv", *rows), source=source)
    assert 4 == _count(log)

    _take(log, _csv(tmp_path / "b.csv", *rows, "10:00,gate,OPEN,0.9"), source="left")

    assert 5 == _count(log)


def test_what_was_taken_back_is_not_held(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """It counts no more, so the row counts anew."""
    first = _take(log, _csv(tmp_path / "a.csv", "08:00,gate,OPEN,0.9")).first_event
    assert first is not None
    log.retract(first + 2)

    again = _csv(tmp_path / "b.csv", "08:00,gate,OPEN,0.9", "09:00,gate,OPEN,")

    assert 2 == _take(log, again).plan.count


def test_many_rows_in_many_parts(
    log: sl.DoorLogWriter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every third row is new, and new doors come among them."""
    monkeypatch.setattr(csv_blocks, "BLOCK_BYTES", 256)
    every = [f"{n // 60:02}:{n % 60:02},door {n // 200},OPEN,0.9" for n in range(600)]
    _take(log, _csv(tmp_path / "a.csv", *(row for n, row in enumerate(every) if n % 3)))

    found = _take(log, _csv(tmp_path / "b.csv", *every))

    assert 200 == found.plan.count
    assert 600 == _count(log)
    assert 3 == len(log.replay().doors)


def test_lines_are_compared_too(
    log: sl.DoorLogWriter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that no log wrote; each with the source that it tells."""
    monkeypatch.setattr(held_sightings, "AT_ONCE", 2)
    log.add_door(name="gate", at="2026-03-01")
    lines = [
        {"kind": "DoorObserved", "door": "gate", "state": "OPEN", "accuracy": 0.9,
         "happened": f"2026-03-01T{hour:02}:00"} | more
        for hour, more in ((8, {}), (9, {"source": "left"}), (10, {"reason": "?"}), (11, {}))
    ]  # fmt: skip
    for name, chosen in (("a", lines[:3]), ("b", lines), ("c", lines[::-1])):
        (tmp_path / f"{name}.jsonl").write_text("".join(json.dumps(x) + "\n" for x in chosen))

    assert [3, 1, 0] == [
        _take(log, tmp_path / f"{name}.jsonl").plan.count for name in ("a", "b", "c")
    ]
    other = json.dumps(lines[1] | {"source": "right"})
    (tmp_path / "d.jsonl").write_text(f"{other}\n")
    assert 1 == _take(log, tmp_path / "d.jsonl").plan.count
    assert 5 == _count(log)


def test_bags_and_csvs_are_compared_with_each_other(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """A bag that was cut into two that overlap; and what a program made of it."""
    said = [Said("/s", *ROBOT.door_state("gate", 2 * (n % 2)), START + n * 70 * S)
            for n in range(6)]  # fmt: skip
    write_mcap(tmp_path / "a.mcap", said[:4])
    write_mcap(tmp_path / "b.mcap", said[2:])

    assert 6 == _take(log, tmp_path / "a.mcap").plan.count
    found = _take(log, tmp_path / "b.mcap").plan

    assert (2, "messages: 4, events: 2; in the log already, by another file: 2") == (
        found.count, found.summary[0],
    )  # fmt: skip
    assert 6 == _count(log)
    (tmp_path / "c.csv").write_text(f"{HEADER}@{START // S}.0,gate,CLOSED,1\n")
    assert 0 == _take(log, tmp_path / "c.csv").plan.count
