"""A bag's scans looked through for a report: what was seen of each door, and kept meanwhile."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.scans.visit import DoorPlaces
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved
from semmap_log.errors import CommandError, FormatError
from semmap_log.interop.formats.kept_scans.reading import kept_visits, scans_of_event
from semmap_log.interop.formats.kept_scans.writing import KeptScansWriter, keeping_scans
from semmap_log.interop.importing.importing import ImportOptions, import_file, plan_scan_import
from semmap_log.interop.importing.scan_reporting import seen_visits
from semmap_log.interop.importing.scan_topics import ScanOptions
from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper
from tests.analysis.scans.some_scans import LINE, seen_visit, some_scan
from tests.analysis.scans.some_visits import some_visit
from tests.interop.formats.bags.bags_of_others import write_mcap
from tests.interop.topics.laser_room import DOOR, SHUT, LaserRoom
from tests.interop.topics.robots import START, S

SCANS = ImportOptions(scan=ScanOptions())


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot drives by the door, which is shut."""
    path = tmp_path_factory.mktemp("bag") / "patrol.mcap"
    write_mcap(path, LaserRoom(state=lambda _: SHUT).said())
    return path


@pytest.fixture
def office(tmp_path: Path) -> Path:
    """A log with the door of the room, and another far away."""
    x, y, theta, width = DOOR
    with sl.create(tmp_path / "office", tz="UTC", robot="tug1") as log:
        log.add_door(x=x, y=y, theta=theta, width=width, name="lab", at=START - S)
        log.add_door(x=x + 90, y=y, theta=theta, width=width, name="attic", at=START - S)
        log.add_door(name="sensor", at=START - S)
    return tmp_path / "office"


def test_a_report_of_a_bag_writes_nothing(office: Path, bag: Path) -> None:
    """Neither to the log nor beside it."""
    before = sorted((path, path.stat().st_size) for path in office.parent.rglob("*"))

    with seen_visits(sl.read(office), [bag], SCANS) as seen:
        report = seen.report()
        (kept,) = (kept for kept in seen.visits(lambda _: True) if not kept.visit.passed)

    (lab,) = report.doors
    assert (lab.door_id, lab.closed, lab.open, lab.undecided) == (1, 1, 0, 0)
    assert abs(lab.behind_m.value) < 0.05
    assert report.not_met == [2]
    assert report.labels[DoorId(1)] == "lab"
    assert any("scans of /scan" in line for line in report.summary)
    assert kept.line == DOOR
    assert len(kept.scans) >= kept.visit.scans
    assert sorted((path, path.stat().st_size) for path in office.parent.rglob("*")) == before


def test_what_is_kept_while_a_bag_is_imported_is_of_its_events(office: Path, bag: Path) -> None:
    """By door and time each sighting finds the scans that it rests on."""
    with sl.append(office) as log:
        with keeping_scans(log.path, log.info.log_id) as writer:
            plan_scan_import(log, bag, SCANS, keeper=ScanKeeper(writer))
        import_file(log, bag, SCANS)
    log = sl.read(office)
    (batch,) = log.batches(kinds=[DoorObserved])
    (happened_ns,) = batch.folds_ns.tolist()

    kept = scans_of_event(office, log.info.log_id, door_id=DoorId(1), happened_ns=happened_ns)

    assert kept is not None
    assert (kept.visit.state, kept.line) == (DoorState.CLOSED, DOOR)
    ends = np.concatenate([
        scan.origins + scan.ranges[:, None] * np.column_stack([
            np.cos(scan.bearings), np.sin(scan.bearings)
        ]) for scan in kept.scans
    ])  # fmt: skip
    on_the_leaf = ends[(ends[:, 0] > 4.1) & (ends[:, 0] < 4.8) & (ends[:, 1] > 1)]
    np.testing.assert_allclose(on_the_leaf[:, 1], DOOR[1], atol=0.02)
    assert len(on_the_leaf) > 50


def test_several_bags_make_one_report(office: Path, bag: Path, tmp_path: Path) -> None:
    """The same visit in two of them counts once."""
    later = LaserRoom(state=lambda _: SHUT)
    write_mcap(tmp_path / "more.mcap", [
        replace(said, at_ns=said.at_ns) for said in later.said()
    ])  # fmt: skip

    with seen_visits(sl.read(office), [bag, tmp_path / "more.mcap"], SCANS) as seen:
        assert seen.report().doors[0].visits == 1


def test_only_some_doors_or_times_are_asked_for(office: Path, bag: Path) -> None:
    """Of others nothing is said, not even that they were not met."""
    log = sl.read(office)

    with seen_visits(log, [bag], SCANS, doors=[DoorId(2)]) as seen:
        assert (seen.report().doors, seen.report().not_met) == ([], [2])
    with seen_visits(log, [bag], SCANS, until_ns=START) as seen:
        assert seen.report().doors == []


def test_without_scans_it_says_what_to_do(office: Path, tmp_path: Path, bag: Path) -> None:
    """No bag, nothing kept; or no door there at that time."""
    log = sl.read(office)
    with (
        pytest.raises(FormatError, match=r"office\.scans: no scans"),
        seen_visits(log, [], SCANS),
    ):
        pass
    empty = sl.create(tmp_path / "empty", tz="UTC")
    empty.close()
    with (
        pytest.raises(CommandError, match="no door of the log has a place"),
        seen_visits(sl.read(tmp_path / "empty"), [bag], SCANS),
    ):
        pass


def test_a_visit_is_kept_with_the_line_of_its_time(tmp_path: Path) -> None:
    """It ends when its door is moved; what is kept is where the door was."""
    writer = KeptScansWriter(tmp_path / "office", "1")
    keeper = ScanKeeper(writer)
    visit, scans = seen_visit(0)
    moved = (9.0, 9.0, 0.5, 1.0)
    keeper.saw(scans, _places(LINE))
    later = some_scan(visit.last_ns + S, 0.0, 0.0)
    keeper.saw([later], _places(moved))

    keeper.keep([visit])
    keeper.keep([replace(visit, first_ns=later.stamp_ns, last_ns=later.stamp_ns)])
    writer.close()

    first, second = kept_visits(tmp_path / "office", "1")
    assert (first.line, second.line) == (LINE, moved)
    assert [len(first.scans), len(second.scans)] == [5, 1]


def test_a_visit_to_a_door_that_was_removed_is_kept(tmp_path: Path) -> None:
    """It is known where the door was."""
    writer = KeptScansWriter(tmp_path / "office", "1")
    keeper = ScanKeeper(writer)
    visit, scans = seen_visit(0)
    keeper.saw(scans, _places(LINE))
    for seconds in (1, 2):  # others change, too
        keeper.saw([some_scan(visit.last_ns + seconds * S, 0.0, 0.0)], _places())

    keeper.keep([visit])
    writer.close()

    assert [kept.line for kept in kept_visits(tmp_path / "office", "1")] == [LINE]


def test_what_nothing_came_of_is_taken_away(tmp_path: Path) -> None:
    """The file, and its folder unless another run's file is in it."""
    first, second = (KeptScansWriter(tmp_path / "office", "1") for _ in range(2))
    for writer in (first, second):
        writer.keep(some_visit(), line=LINE, level=0, scans=[])
    second.discard()
    assert first.path is not None
    assert [path.name for path in (tmp_path / "office.scans").iterdir()] == [first.path.name]

    first.discard()
    first.close()

    assert not list(tmp_path.iterdir())
    assert first.path is None


def _places(*lines: tuple[float, float, float, float]) -> DoorPlaces:
    return DoorPlaces(
        ids=np.arange(1, len(lines) + 1),
        levels=np.zeros(len(lines), np.int64),
        lines=np.array(lines, np.float64).reshape(-1, 4),
        kinds=("",) * len(lines),
        glass=np.zeros(len(lines), np.bool_),
    )
