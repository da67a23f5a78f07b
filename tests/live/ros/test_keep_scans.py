"""`--keep-scans`: what a laser saw is kept beside the log, live and of a bag alike."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.scans.visit import KeptVisit, scans_folder
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorObserved
from semmap_log.errors import CommandError, FormatError, OutputError
from semmap_log.interop.formats.kept_scans.reading import kept_visits
from semmap_log.interop.formats.kept_scans.writing import keeping_scans
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.importing.scan_topics import ScanOptions
from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper
from semmap_log.interop.topics.topic_rules import WELL_KNOWN, ReadScan
from semmap_log.live.ros.ros_recorder import LogSink, RosRecorder
from tests.interop.formats.bags.bags_of_others import Said, write_mcap
from tests.interop.topics.laser_room import DOOR, LaserRoom, drives_by
from tests.interop.topics.robots import START, S
from tests.live.ros.memory_node import MemoryNode
from tests.verbs import Refuses, run

SCANS = ImportOptions(scan=ScanOptions())


def _office(path: Path) -> Path:
    x, y, theta, width = DOOR
    with sl.create(path, tz="UTC", robot="tug1", compact=False) as log:
        log.add_door(x=x, y=y, theta=theta, width=width, name="lab", at=START - 3600 * S)
    return path


def _record(path: Path, said: Iterable[Said], heard: list[str]) -> None:
    """Record what is said, keeping the scans."""
    all_said = list(said)

    def during(node: MemoryNode) -> None:
        for each in all_said:
            node.say(each)

    node = MemoryNode(during, {each.topic: each.ros_type for each in all_said})
    mapping = replace(WELL_KNOWN, scans=ReadScan())
    with (
        sl.append(path, durability="none", compact=False) as log,
        keeping_scans(path, log.info.log_id) as writer,
    ):
        keeper = ScanKeeper(writer, tell=heard.append)
        RosRecorder(node, mapping, LogSink(log), heard.append, keeper).run()  # type: ignore[arg-type]


def _kept(path: Path) -> list[KeptVisit]:
    return list(kept_visits(path, sl.read(path).info.log_id))


def _states(path: Path) -> list[DoorState]:
    batches = sl.read(path).batches(kinds=[DoorObserved])
    return [each.event.state for batch in batches for each in batch]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot drives by the open door, and again by the shut one."""
    path = tmp_path_factory.mktemp("bag") / "patrol.mcap"
    write_mcap(path, drives_by())
    return path


def test_live_or_from_a_bag_the_same_is_kept(tmp_path: Path, bag: Path) -> None:
    """Visits with their scans, of which the log has the sightings."""
    live, imported = (_office(tmp_path / name) for name in ("live", "imported"))
    _record(live, drives_by(), [])
    with sl.append(imported) as log:
        import_file(log, bag, SCANS, keep_scans=True)

    kept = _kept(live)

    assert [one.visit.state for one in kept] == [DoorState.OPEN, DoorState.CLOSED] == _states(live)
    assert [repr(one.visit) for one in kept] == [repr(one.visit) for one in _kept(imported)]
    assert all(len(one.scans) >= one.visit.scans > 10 for one in kept)
    assert {one.line for one in kept} == {DOOR}


def test_what_was_imported_before_can_be_kept_later_and_once(tmp_path: Path, bag: Path) -> None:
    """The log has its sightings already; the scans of a visit are never there twice."""
    office = _office(tmp_path / "office")
    with sl.append(office) as log:
        import_file(log, bag, SCANS)
        assert not scans_folder(office).exists()
        import_file(log, bag, SCANS, keep_scans=True)
        files = sorted(scans_folder(office).iterdir())
        import_file(log, bag, SCANS, keep_scans=True)

    assert sorted(scans_folder(office).iterdir()) == files
    assert len(_kept(office)) == 2
    assert len(_states(office)) == 2


def test_an_import_that_is_refused_keeps_nothing(tmp_path: Path, bag: Path) -> None:
    """A bag cut in the middle; a bag of which no laser is read; what is no bag."""
    office = _office(tmp_path / "office")
    (tmp_path / "cut.mcap").write_bytes(bag.read_bytes()[:-9000])
    (tmp_path / "doors.csv").write_text("timestamp,door,state\n", encoding="utf-8")
    cases = [("cut.mcap", FormatError), ("doors.csv", CommandError)]

    with sl.append(office) as log:
        for name, error in cases:
            with pytest.raises(error):
                import_file(log, tmp_path / name, SCANS, keep_scans=True)
        with pytest.raises(CommandError, match="no laser is read: name it with --scan"):
            import_file(log, bag, ImportOptions(), keep_scans=True)

    assert not scans_folder(office).exists()


def test_an_import_that_breaks_off_keeps_nothing(tmp_path: Path) -> None:
    """Behind the first visit, before the bag is read to its end."""
    office, called = _office(tmp_path / "office"), list[bool]()
    drives = (LaserRoom(tf_hz=100.0, begins_s=60.0 * n) for n in range(2))
    write_mcap(tmp_path / "x.mcap", [said for drive in drives for said in drive.said()])

    def break_off(_done: int, _all: int) -> None:
        called.append(scans_folder(office).exists())
        if called[-1]:
            raise KeyboardInterrupt

    with sl.append(office) as log, pytest.raises(KeyboardInterrupt):
        import_file(log, tmp_path / "x.mcap", SCANS, keep_scans=True, progress=break_off)

    assert called[-1]
    assert not scans_folder(office).exists()


def test_a_recorder_goes_on_where_nothing_more_can_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is said once; every sighting is in the log, and what was kept stays readable."""
    office, heard = _office(tmp_path / "office"), list[str]()
    from semmap_log.interop.formats.kept_scans.writing import KeptScansWriter

    keep, calls = KeptScansWriter.keep, list[int]()

    def full_disk(*args: object, **kwargs: object) -> None:
        calls.append(1)
        if len(calls) > 1:
            raise OutputError("office.scans: could not be written: No space left on device")
        keep(*args, **kwargs)  # type: ignore[arg-type]

    monkeypatch.setattr(KeptScansWriter, "keep", full_disk)
    said = [*drives_by(), *LaserRoom(begins_s=120.0).said()]

    _record(office, said, heard)

    assert len(_states(office)) == 3
    assert len(calls) == 2
    assert [text for text in heard if "no more scans are kept: " in text] == [
        "no more scans are kept: office.scans: could not be written: No space left on device"
    ]
    assert len(_kept(office)) == 1


@pytest.mark.usefixtures("terminal")
def test_as_a_user_types_it(tmp_path: Path, bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Import, then ask for the report of what was kept."""
    office = _office(tmp_path / "office")

    assert run("import", office, bag, "--scan", "--keep-scans") == 0
    assert "office.scans: the scans of visits." in " ".join(capsys.readouterr().err.split())
    assert run("scan-report", office) == 0

    lab = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("lab"))
    assert lab.split()[1:5] == ["2", "1", "1", "0"]


@pytest.mark.usefixtures("terminal")
def test_options_that_make_no_sense_are_refused(tmp_path: Path, refuses: Refuses) -> None:
    """As wrong command lines."""
    office = _office(tmp_path / "office")

    refuses(f"""
        import {office} x.bag --scan --keep-scans --dry-run
        record {office} --ros2 --keep-scans
        record {office} --keep-scans
    """)
