"""A log as tables: the same as its history, told row by row."""

from __future__ import annotations

import random
from contextlib import suppress
from pathlib import Path
from typing import Any

import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import semmap_log as sl
from semmap_log.core.arrow.table import COLUMNS, HISTORY_COLUMNS
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAnnotated, DoorObserved, LevelAdded, RobotPose
from semmap_log.errors import CommandError, SemmapError
from semmap_log.store.compaction import compact
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock
from tests.core.arrow.rows import history_rows, rows_of

HOUR_NS = 3600 * 10**9


def written(folder: Path, seed: int) -> sl.DoorLog:
    """Write a log of doors and levels whose names change, in any order, and are taken back."""
    dice = random.Random(seed)
    path, clock = folder / f"log{seed}", SteadyClock()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", 30)
        with sl.create(path, tz="UTC", clock=clock, durability="none", compact=False) as log:
            for _ in range(150):
                clock.now_ns += dice.randrange(HOUR_NS)
                with suppress(SemmapError):  # of a door that is gone, or not yet there, and such
                    command(dice, log, clock.now_ns)
    if seed % 2:
        compact(path)
    return sl.read(path)


def command(dice: random.Random, log: sl.DoorLogWriter, now_ns: int) -> None:
    """Append something; two in five of it long after it happened."""
    at = now_ns - dice.choice([0, 0, 0, HOUR_NS, dice.randrange(40 * HOUR_NS)])
    doors, level = sorted(log.state.used_door_ids), dice.choice([0, 0, 1, 2])
    door = DoorId(dice.choice(doors)) if doors else DoorId(1)
    about: dict[str, Any] = {"at": at, "actor": dice.choice(["", "ann", "bob"]),
                             "reason": dice.choice(["", f"no. {dice.randrange(9)}"])}  # fmt: skip
    match dice.randrange(11):
        case 0:
            log.add_door(x=0, y=0, theta=0, width=1, level=level, **about)
        case 1:
            log.add_door(name=f"n{dice.randrange(99)}", **about)
        case 2 | 3:
            log.annotate(door, "name", dice.choice(["", "a", "b", "c", "d"]), **about)
        case 4:
            log.annotate(door, "rooms", "1, 2", **about)
        case 5:
            name = dice.choice(["", "EG", "OG"])
            log.append([LevelAdded(level=level, name=name, happened_ns=at)])
        case 6:
            log.update_door(door, x=1, y=1, theta=0, width=1, level=level, **about)
        case 7:
            last = log.state.event
            first = dice.randint(max(0, last - 3), max(0, last))
            log.retract(first, min(last, first + dice.randrange(2)))
        case 8 if len(doors) > 3:
            log.remove_door(door, **about)
        case 9:
            seen = [
                DoorObserved(door_id=door, state=DoorState.OPEN, happened_ns=at)
            ] * dice.randint(1, 9)
            log.append([*seen, RobotPose(level=level, x=0, y=0, theta=0, happened_ns=at)],
                       note=sl.Note(source=f"cam{dice.randrange(3)}", correlation="c"))  # fmt: skip
        case _:
            log.observe(door, "open", **about)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[sl.DoorLog]:
    folder = tmp_path_factory.mktemp("logs")
    return [written(folder, seed) for seed in range(8)]


def test_each_row_is_what_the_history_tells(logs: list[sl.DoorLog]) -> None:
    """All columns, names as they were then by what is known now."""
    seen: list[dict[str, Any]] = []
    for log in logs:
        rows = list(history_rows(list(log.history())))
        seen += rows

        assert rows == rows_of(log.to_arrow(retracted=True))
        assert [row for row in rows if not row["retracted"]] == rows_of(log.to_arrow())

    assert {None, "a", "b", "c", "d"} < {row["door_name"] for row in seen}
    assert {None, "0", "1", "2", "EG", "OG"} == {row["level_name"] for row in seen}
    assert any(row["retracted"] for row in seen)
    assert {"RobotPose", "DoorUpdated", "Retracted"} < {row["kind"] for row in seen}
    assert any(row["kind"] == "DoorRemoved" and row["door_name"] for row in seen)


def test_names_are_those_of_a_replay_at_that_time(logs: list[sl.DoorLog]) -> None:
    """Of each moment at which one thing happened, and a door that is in the map then."""
    compared = 0
    for log in logs:
        rows = log.to_arrow(columns=["door_id", "door_name", "level_name", "kind"]).to_pylist()
        entries = [entry for entry in log.history() if not entry.retracted]
        for entry, row in list(zip(entries, rows, strict=True))[::4]:
            doors = log.replay(at=entry.folds_ns)
            alone = sum(other.folds_ns == entry.folds_ns for other in entries) == 1
            if alone and row["door_id"] in doors.doors:
                door = doors[row["door_id"]]
                told = (door.name, doors.level_name(door.level))
                assert told == (row["door_name"], row["level_name"])
                compared += 1

    assert compared > 50


def test_names_stay_where_nothing_was_taken_from_the_log(logs: list[sl.DoorLog]) -> None:
    """Tables that follow each other are the one table."""
    for log in logs:
        parts = list(log.tables(retracted=True))

        assert all(part.num_rows for part in parts)
        assert rows_of(log.to_arrow(retracted=True)) == [row for p in parts for row in rows_of(p)]


def test_windows_doors_and_kinds_choose_rows(logs: list[sl.DoorLog]) -> None:
    """As they do for `batches`; each row is the same as in the table of all."""
    for seed, log in enumerate(logs):
        dice = random.Random(seed)
        everything = {row["event"]: row for row in rows_of(log.to_arrow(retracted=True))}
        moments = sorted(row["recorded"] for row in everything.values())
        since, until = sorted(dice.sample(moments, 2))
        door = dice.choice([row["door_id"] for row in everything.values() if row["door_id"]])
        choices: list[dict[str, Any]] = [
            {"since": since, "until": until},
            {"since": since, "until": until, "recorded": True},
            {"since": "event:20", "until": "event:31", "retracted": True},
            {"doors": [DoorId(door)], "until": until},
            {"doors": []},
            {"kinds": [DoorAnnotated, LevelAdded], "since": since},
            {"since": until, "until": until},
        ]
        for choice in choices:
            wanted = [n for batch in log.batches(**choice) for n in batch.number.tolist()]

            rows = rows_of(log.to_arrow(**choice))

            assert [everything[number] for number in wanted] == rows


COLUMN_NAMES = [column.name for column in HISTORY_COLUMNS]


@pytest.mark.parametrize("seed", range(20))
def test_columns_are_those_that_are_asked_for(logs: list[sl.DoorLog], seed: int) -> None:
    """In that order; each holds what it holds in the table of all."""
    log, dice = logs[seed % len(logs)], random.Random(seed)
    names = dice.sample(COLUMN_NAMES, dice.randint(1, 6))

    table = log.to_arrow(columns=names)

    assert names == table.column_names
    assert table.schema == log.to_arrow().schema.empty_table().select(names).schema
    assert rows_of(table) == rows_of(log.to_arrow().select(names))


def test_no_columns_are_no_columns(logs: list[sl.DoorLog]) -> None:
    assert [] == logs[0].to_arrow(columns=[]).column_names


@pytest.mark.parametrize("names", [["event", "colour"], ["event", "event"], "colour"])
def test_a_column_that_is_not_there_is_an_error(
    logs: list[sl.DoorLog], names: list[str] | str
) -> None:
    """It says which there are, before anything is read."""
    with pytest.raises(CommandError, match=r"expected some of event, kind, .*got '(colour|event)'"):
        logs[0].tables(columns=names)


def test_a_log_without_events_is_a_table_without_rows(tmp_path: Path) -> None:
    """With all its columns and their types, for pandas and polars, too."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        empty = log.to_arrow()
        log.add_door()
        full = log.to_arrow()

        assert (0, 1) == (empty.num_rows, full.num_rows)
        assert empty.schema == full.schema
        assert COLUMN_NAMES == log.to_pandas(kinds=[LevelAdded]).columns.tolist()
        assert COLUMN_NAMES == log.to_polars(kinds=[LevelAdded]).columns


def test_the_frames_have_types_that_can_be_worked_with(logs: list[sl.DoorLog]) -> None:
    """Categories for texts that many rows share, times with their zone, whole numbers."""
    types = {
        "event": ("int64", pl.Int64),
        "kind": ("category", pl.Categorical),
        "door_id": ("UInt32", pl.UInt32),
        "door_name": ("category", pl.Categorical),
        "actor": ("category", pl.Categorical),
        "happened": ("datetime64[ns, UTC]", pl.Datetime("ns", "UTC")),
        "retracted": ("bool", pl.Boolean),
    }
    log, names = logs[1], list(types)
    table = log.to_arrow(columns=names)

    pandas, polars = log.to_pandas(columns=names), log.to_polars(columns=names)

    assert list(types.values()) == list(zip(map(str, pandas.dtypes), polars.dtypes, strict=True))
    for name in ("event", "kind", "door_name", "actor"):
        told = table[name].to_pylist()
        assert told == polars[name].to_list()
        assert told == [None if pd.isna(each) else each for each in pandas[name].tolist()]


def test_the_dictionaries_of_a_table_are_one(logs: list[sl.DoorLog]) -> None:
    """Whatever the parts of a log told: who looks at the codes can compare them."""
    table = logs[0].to_arrow(retracted=True)

    for field in table.schema:
        if pa.types.is_dictionary(field.type):
            chunks = table[field.name].chunks
            assert all(chunks[0].dictionary.equals(chunk.dictionary) for chunk in chunks)


def test_the_columns_of_a_batch_are_among_them() -> None:
    """Under the same names, with the same meaning."""
    assert set(COLUMNS) < set(HISTORY_COLUMNS)
