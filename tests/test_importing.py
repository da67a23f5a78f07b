"""Real files into a log: what the log then says is what the files say."""

from __future__ import annotations

import bisect
import csv
import gzip
import random
from collections import defaultdict
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorObserved, DoorUpdated, LevelAdded
from semmap_log.errors import DoorExistsError, DoorRemovedError, FormatError, UnknownLevelError
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.importing.importing import ImportOptions, import_file


def _ns(text: str, zone: str) -> int:
    """Return a local wall clock as UTC nanoseconds, by the standard library."""
    local = datetime.fromisoformat(text).replace(tzinfo=ZoneInfo(zone))
    return round(local.timestamp() * 1_000_000) * 1000


class Csv:
    """A door set as its README defines it, read as plainly as can be."""

    def __init__(self, folder: Path, zone: str) -> None:
        self.rows: dict[str, list[tuple[int, str]]] = defaultdict(list)
        self.windows: dict[str, list[tuple[int, int]]] = defaultdict(list)
        with gzip.open(folder / "doors.csv.gz", "rt", encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                self.rows[row["door"]].append((_ns(row["timestamp"], zone), row["state"]))
        with (folder / "obs_windows.csv").open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                self.windows[row["door"]].append((_ns(row["start"], zone), _ns(row["end"], zone)))

    def state(self, door: str, ns: int) -> str | None:
        """Return a door's state at a moment; None: before its first row."""
        rows = self.rows[door]
        known = bisect.bisect_right(rows, ns, key=lambda row: row[0])
        if not known:
            return None
        inside = any(start <= ns < end for start, end in self.windows[door])
        return rows[known - 1][1] if inside else "UNKNOWN"


SETS = {
    "workshop_3y": ("Europe/Oslo", 1),
    "spaces_polled": ("UTC", 142),
    "home_b": ("Europe/Amsterdam", 3),
    "home_e": ("America/New_York", 5),
    "office_9d": ("UTC", 1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_the_log_agrees_with_the_csv_at_random_moments(
    name: str, shared_data: Path, tmp_path: Path
) -> None:
    """1,000 moments: between rows, exactly on rows, on starts and ends of windows."""
    zone, count = SETS[name]
    folder = shared_data / "doors" / name
    truth = Csv(folder, zone)
    options = ImportOptions(windows=folder / "obs_windows.csv", tz=zone)
    with sl.create(tmp_path / "log", tz=zone) as log:
        import_file(log, folder / "doors.csv.gz", options)
        doors = {door.name: door.door_id for door in log.replay().doors.values()}
        timelines = {door: _timeline(log, door_id) for door, door_id in doors.items()}
    assert count == len(doors)
    dice = random.Random(name)
    edges = [t for door in truth.rows for t, _ in truth.rows[door]]
    edges += [t for windows in truth.windows.values() for window in windows for t in window]
    moments = [
        dice.choice(edges) + dice.choice([0, 0, -1, 1, dice.randrange(10**13)]) for _ in range(1000)
    ]

    for ns in moments:
        door = dice.choice(list(doors))
        expected = truth.state(door, ns)
        assert expected == _state_at(timelines[door], ns), (door, ns)
    for ns in moments[:25]:
        door_map = sl.read(tmp_path / "log").replay(at=ns)
        for door, door_id in doors.items():
            found = door_map.doors.get(door_id)
            assert truth.state(door, ns) == (found.state.name if found else None), (door, ns)


def _timeline(log: sl.DoorLog, door: DoorId) -> list[tuple[int, str]]:
    """Return (happened, state) of a door's history, in order."""
    said = [
        (entry.happened_ns, entry.number, entry.event.state.name)
        for entry in log.history(door, kinds=[DoorUpdated, DoorObserved])
        if isinstance(entry.event, (DoorUpdated, DoorObserved))
    ]
    return [(happened, state) for happened, _, state in sorted(said)]


def _state_at(timeline: list[tuple[int, str]], ns: int) -> str | None:
    known = bisect.bisect_right(timeline, ns, key=lambda entry: entry[0])
    return timeline[known - 1][1] if known else None


@pytest.mark.slow
def test_the_workshop_is_open_a_fifth_of_its_known_time(shared_data: Path, tmp_path: Path) -> None:
    """The published figure, from the log: 0.179 of the time in which the state is known."""
    folder = shared_data / "doors" / "workshop_3y"
    with sl.create(tmp_path / "log", tz="Europe/Oslo") as log:
        options = ImportOptions(windows=folder / "obs_windows.csv")
        imported = import_file(log, folder / "doors.csv.gz", options)
        timeline = _timeline(log, DoorId(1))
    spans: dict[str, int] = defaultdict(int)
    for (start, state), (end, _) in pairwise(timeline):
        spans[state] += end - start

    assert 0.179 == round(spans["OPEN"] / (spans["OPEN"] + spans["CLOSED"]), 3)
    assert 30_414 <= imported.plan.count


def test_every_name_of_every_script_is_kept(shared_data: Path, tmp_path: Path) -> None:
    """142 doors with slashes, spaces and letters beyond ASCII; each is found by its name."""
    folder = shared_data / "doors" / "spaces_polled"
    truth = Csv(folder, "UTC")
    with sl.create(tmp_path / "log", tz="UTC") as log:
        import_file(log, folder / "doors.csv.gz", ImportOptions(windows=folder / "obs_windows.csv"))

        assert set(truth.rows) == {door.name for door in log.replay().doors.values()}
        for name in truth.rows:
            assert name == log.replay()[log.resolve(name)].name


@pytest.mark.parametrize(
    ("building", "doors", "levels"),
    [("rmf_office/office", 3, 1), ("rmf_clinic/clinic", 140, 2), ("rmf_hotel/hotel", 25, 3)],
)
def test_buildings_come_with_names_levels_and_floor_plans(
    building: str, doors: int, levels: int, shared_data: Path, tmp_path: Path
) -> None:
    """Every door placed, named, on a level that has a floor plan."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        imported = import_file(log, shared_data / "maps" / f"{building}.building.yaml")
        door_map = log.replay()
        plans = [log.floor_map(level) for level in door_map.levels]

    assert (doors, levels) == (len(door_map.doors), len(door_map.levels))
    assert all(door.is_placed and door.name for door in door_map.doors.values())
    assert all(plan is not None and plan.cells.size > 1000 for plan in plans)
    assert ["named points" in text for text in imported.plan.left_out] == [True]


def test_a_level_that_is_not_there_is_named(shared_data: Path, tmp_path: Path) -> None:
    """The message says which levels there are; nothing is written."""
    file = shared_data / "maps" / "rmf_hotel" / "hotel.building.yaml"
    with sl.create(tmp_path / "log", tz="UTC") as log:
        with pytest.raises(FormatError, match=r"L1, L2, L3; got .L9"):
            import_file(log, file, ImportOptions(level="L9"))

        assert -1 == log.replay().event


def test_all_of_a_file_or_nothing(tmp_path: Path) -> None:
    """One bad row at the end of a CSV: no event of it is in the log."""
    file = tmp_path / "doors.csv"
    good = "".join(f"2026-03-01T{h:02}:00,front,OPEN\n" for h in range(24))
    file.write_text(f"timestamp,door,state\n{good}2026-03-02T00:00,front,AJAR\n")
    with sl.create(tmp_path / "log", tz="UTC") as log:
        with pytest.raises(FormatError, match=r"doors.csv:26: .*AJAR"):
            import_file(log, file)

        assert -1 == log.replay().event
        assert {} == log.replay().doors


def test_ids_that_are_taken_or_gone(tmp_path: Path) -> None:
    """Other values: an error unless --update."""
    file = tmp_path / "doors.yaml"
    entry = "{}:\n  position: {{x: 1, y: 2, theta: 0}}\n  width: 1\n  status: OPEN\n"
    file.write_text(entry.format(1) + entry.format(2))
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(x=0, y=0, theta=0, width=1)
        log.add_door(x=1, y=2, theta=0, width=1, state="open")
        with pytest.raises(DoorExistsError, match="--update"):
            import_file(log, file)
        log.remove_door(DoorId(1))
        with pytest.raises(DoorRemovedError, match="--renumber"):
            import_file(log, file)

        import_file(log, file, ImportOptions(renumber=True))

        assert [2, 3] == list(log.replay().doors)
        assert 1.0 == log.replay()[DoorId(3)].x

        log.append([LevelAdded(level=1, name="L1"), LevelAdded(level=2, name="L2")])
        plan = import_file(log, file, ImportOptions(update=True)).plan

        assert [1, 2, 3] == list(log.replay().doors)
        assert ("doors: 1 brought back, 1 the same already",
                "door 1: its removal, event 2, is taken back") == plan.summary  # fmt: skip
        assert (1.0, 0) == (log.replay()[DoorId(1)].x, log.replay()[DoorId(1)].level)


def test_a_yaml_of_a_building_with_levels_comes_back(shared_data: Path, tmp_path: Path) -> None:
    """The thesis's format has no levels: doors that are there stay on theirs."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        import_file(log, shared_data / "maps" / "rmf_hotel" / "hotel.building.yaml")
        export(log, tmp_path / "hotel.yaml", default_prob=0.5)
        before = log.replay()
        import_file(log, tmp_path / "hotel.yaml", ImportOptions(update=True))
        (tmp_path / "new.yaml").write_text("99:\n  position: {x: 1, y: 2, theta: 0}\n  width: 1\n")
        with pytest.raises(UnknownLevelError, match="say which"):
            import_file(log, tmp_path / "new.yaml")
        import_file(log, tmp_path / "new.yaml", ImportOptions(level="L2"))
        after = log.replay()

    assert [door.pose for door in before.doors.values()] == [
        door.pose for door in after.doors.values() if door.door_id != 99
    ]
    assert 2 == after[DoorId(99)].level
