"""Bags with a laser's scans into a log: what the robot saw of the doors, visit by visit."""

from __future__ import annotations

import json
import math
import re
import shlex
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorObserved, DoorPassed, LevelAdded, RobotPose
from semmap_log.errors import CommandError, FormatError
from semmap_log.interop.formats.ros.ros_types import TRANSFORMS
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.importing.scan_topics import ScanOptions
from tests.interop.formats.bags.bags_of_others import Said, write_mcap, write_ros1, write_ros2
from tests.interop.topics.laser_room import DOOR, SHUT, LaserRoom, drives_by, moved, turned
from tests.interop.topics.robots import START, Robot, S

SCANS = ImportOptions(scan=ScanOptions())
LONG_AGO = START - 3600 * S


@pytest.fixture
def office(tmp_path: Path) -> Path:
    """A log with the door of the room, there since long ago."""
    x, y, theta, width = DOOR
    with sl.create(tmp_path / "office", tz="UTC", robot="tug1") as log:
        log.add_door(x=x, y=y, theta=theta, width=width, name="lab", at=LONG_AGO)
    return tmp_path / "office"


def _import(office: Path, path: Path, options: ImportOptions = SCANS) -> Any:
    with sl.append(office) as log:
        return import_file(log, path, options)


def _run(*words: object) -> Any:
    """Return a verb's exit code."""
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    return left.value.code


def _events(office: Path, *kinds: type[Any]) -> list[Any]:
    return [each.event for batch in sl.read(office).batches(kinds=kinds) for each in batch]


def _states(office: Path) -> list[DoorState]:
    return [each.state for each in _events(office, DoorObserved)]


def _ros1_bag(path: Path) -> Path:
    write_ros1(path / "patrol.bag", drives_by(1))
    return path / "patrol.bag"


def _mcap(path: Path) -> Path:
    write_mcap(path / "patrol.mcap", drives_by())
    return path / "patrol.mcap"


def _folder(storage: Any) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        write_ros2(path / "patrol", drives_by(), storage)
        return path / "patrol"

    return write


@pytest.mark.parametrize(
    "write", [_ros1_bag, _mcap, _folder("sqlite3"), _folder("mcap")],
    ids=["ROS 1", "MCAP", "sqlite3", "rosbag2 MCAP"],
)  # fmt: skip
def test_a_door_that_is_open_and_then_shut_is_seen_so(
    write: Callable[[Path], Path], office: Path, tmp_path: Path
) -> None:
    """Each visit is a commit: where the robot was at its first and last look, and what it saw."""
    imported = _import(office, write(tmp_path))

    commits = list(sl.read(office).commits())[1:]
    assert [DoorState.OPEN, DoorState.CLOSED] == _states(office)
    assert [3, 3] == [commit.count for commit in commits]
    assert {("tug1", "scan:laser leaf-likelihood")} == {
        (commit.note.actor, commit.note.source) for commit in commits
    }
    assert all("patrol" in commit.note.correlation for commit in commits)
    opened, shut = _events(office, DoorObserved)
    assert opened.accuracy_open == opened.accuracy_closed
    assert 0.8 < shut.accuracy_closed < 1.0
    assert shut.opening < 0.2
    assert 0.8 < opened.opening
    poses = _events(office, RobotPose)
    assert [poses[1].happened_ns, poses[3].happened_ns] == [opened.happened_ns, shut.happened_ns]
    assert all(0.9 < pose.x < 8.3 for pose in poses)
    assert START <= poses[0].happened_ns < opened.happened_ns < START + 12 * S
    assert START + 60 * S <= poses[2].happened_ns < shut.happened_ns < START + 72 * S
    assert imported.plan.count == 6
    told = "visits: 2 to 1 door: 1 OPEN, 1 CLOSED, 0 driven through, 0 undecided"
    assert told == imported.plan.summary[-1]


def test_the_same_bag_again_changes_nothing(office: Path, tmp_path: Path) -> None:
    """By whatever options it finds the same laser."""
    path = _mcap(tmp_path)
    mapping = tmp_path / "robot.yaml"
    mapping.write_text("topics: {/scan: scan}\n")
    _import(office, path)
    before = {each: each.read_bytes() for each in office.iterdir()}

    again = _import(office, path)
    named = _import(office, path, ImportOptions(scan=ScanOptions(("/scan",))))
    by_file = _import(office, path, ImportOptions(mapping=mapping))

    assert "of them in the log already: 2" in again.plan.summary
    assert () == again.plan.warnings == again.plan.left_out
    assert [None] * 3 == [each.first_event for each in (again, named, by_file)]
    assert before == {each: each.read_bytes() for each in office.iterdir()}


def test_an_import_that_was_interrupted_goes_on(
    office: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is stored stays, what is missing comes: the log holds each visit once."""
    path = _mcap(tmp_path)
    real = sl.DoorLogWriter.append
    calls = []

    def dying(self: Any, *args: Any, **options: Any) -> Any:
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(self, *args, **options)

    monkeypatch.setattr(sl.DoorLogWriter, "append", dying)
    with pytest.raises(KeyboardInterrupt):
        _import(office, path)
    assert [DoorState.OPEN] == _states(office)
    monkeypatch.undo()

    imported = _import(office, path)

    assert [DoorState.OPEN, DoorState.CLOSED] == _states(office)
    assert 3 == imported.plan.count


def test_visits_that_the_robot_recorded_while_it_drove_count_once(
    office: Path, tmp_path: Path
) -> None:
    """Its bag is of the same looks: what the log has of that laser at that time is left out."""
    path = _mcap(tmp_path)
    with sl.append(office) as log:
        log.append(
            [DoorObserved(door_id=1, state=DoorState.OPEN, happened_ns=START + 9 * S)],
            note=sl.Note(actor="tug1", source="scan:laser leaf-likelihood"),
        )

    imported = _import(office, path)

    assert [DoorState.OPEN, DoorState.CLOSED] == _states(office)
    assert "left out, since the log has visits of that laser then: 1" in imported.plan.warnings


@pytest.mark.parametrize("names", [("ann", ""), ("", "ann"), ("ann", "bob")])
def test_the_same_drive_in_another_name_counts_once(
    names: tuple[str, str], office: Path, tmp_path: Path
) -> None:
    """As a converter or a second recorder writes it: no two robots were there."""
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    write_mcap(first, drives_by())
    write_mcap(second, drives_by()[5:])
    with sl.append(office) as log:
        import_file(log, first, SCANS, note=Note(actor=names[0]))
        imported = import_file(log, second, SCANS, note=Note(actor=names[1]))

    assert [DoorState.OPEN, DoorState.CLOSED] == _states(office)
    assert "left out, since the log has visits of that laser then: 2" in imported.plan.warnings


def test_another_robot_that_saw_the_door_meanwhile_counts_too(office: Path, tmp_path: Path) -> None:
    """Its laser is called the same; it was elsewhere."""
    other = LaserRoom(drive=lambda t: moved(10.0 - 0.6 * t, -0.6))
    write_mcap(tmp_path / "one.mcap", LaserRoom().said())
    write_mcap(tmp_path / "other.mcap", other.said())
    with sl.append(office) as log:
        import_file(log, tmp_path / "one.mcap", SCANS, note=Note(actor="tug2"))
        import_file(log, tmp_path / "other.mcap", SCANS)

    assert [DoorState.OPEN, DoorState.OPEN] == _states(office)


def test_a_visit_that_does_not_decide_writes_nothing(office: Path, tmp_path: Path) -> None:
    """A leaf that stands at 40 degrees: the door keeps the state that it had."""
    across = 0.9 * math.cos(math.radians(40)), 0.9 * math.sin(math.radians(40))
    leaf = [(4.0, 1.2, 4.0 + across[0], 1.2 + across[1])]
    write_mcap(tmp_path / "x.mcap", LaserRoom(state=lambda _: leaf).said())

    imported = _import(office, tmp_path / "x.mcap")

    assert "1 undecided" in imported.plan.summary[1]
    assert [] == _states(office)
    assert 0 == imported.plan.count


def test_other_topics_of_the_bag_are_read_too(office: Path, tmp_path: Path) -> None:
    """As one commit, the same as without the scans: who imports them later has nothing twice."""
    contact = Said("/door_states", *Robot().door_state("front", 2), START + S)
    write_mcap(tmp_path / "x.mcap", [*drives_by(), contact])

    _import(office, tmp_path / "x.mcap", ImportOptions())
    assert [DoorState.OPEN] == _states(office)
    imported = _import(office, tmp_path / "x.mcap")

    assert (5, 6) == (imported.first_event, imported.plan.count)
    assert [DoorState.OPEN, DoorState.OPEN, DoorState.CLOSED] == _states(office)
    assert ["lab", "front"] == [door.name for door in sl.read(office).replay().doors.values()]


def test_doors_that_the_bag_itself_adds_are_seen(tmp_path: Path) -> None:
    """A server's DoorMap comes with it."""
    sl.create(tmp_path / "office", tz="UTC").close()
    x, y, theta, width = DOOR
    door = {"door_id": 7, "pos_x": x, "pos_y": y, "pos_theta": theta, "width": width}
    server = Said("/doors", *Robot().door_map([door]), START + S // 10)
    write_mcap(tmp_path / "x.mcap", sorted([server, *drives_by()], key=lambda each: each.at_ns))

    _import(tmp_path / "office", tmp_path / "x.mcap")

    seen = _events(tmp_path / "office", DoorObserved)
    assert [(7, DoorState.OPEN), (7, DoorState.CLOSED)] == [(e.door_id, e.state) for e in seen]


def test_the_doors_are_those_of_the_moment(office: Path, tmp_path: Path) -> None:
    """One that was removed between two visits is seen once; one that came then, from then on."""
    x, y, theta, width = DOOR
    with sl.append(office) as log:
        log.remove_door(1, at=START + 30 * S)
        log.add_door(x=x, y=y, theta=theta, width=width, name="new", at=START + 31 * S)

    _import(office, _mcap(tmp_path))

    seen = _events(office, DoorObserved)
    assert [(1, DoorState.OPEN), (2, DoorState.CLOSED)] == [(e.door_id, e.state) for e in seen]


def test_a_door_that_was_moved_is_where_it_was_then(office: Path, tmp_path: Path) -> None:
    """Its first visit is told, though today it is drawn elsewhere."""
    with sl.append(office) as log:
        log.update_door(1, x=40.0, y=1.0, theta=0.0, at=START + 30 * S)

    _import(office, _mcap(tmp_path))

    assert [DoorState.OPEN] == _states(office)


def test_doors_that_were_added_today_were_there_if_one_says_so(tmp_path: Path) -> None:
    """Last week's bag and a door that was added just now: refused, with the line that helps."""
    x, y, theta, width = DOOR
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(x=x, y=y, theta=theta, width=width)
    path = _mcap(tmp_path)

    with pytest.raises(CommandError, match=r"added later.*--scan --since"):
        _import(tmp_path / "office", path)
    assert 1 == len(list(sl.read(tmp_path / "office").commits()))
    _import(tmp_path / "office", path, replace(SCANS, since_ns=START - S))

    assert [DoorState.OPEN, DoorState.CLOSED] == _states(tmp_path / "office")
    (door,) = sl.read(tmp_path / "office").replay(at=START + 30 * S).doors.values()
    assert DoorState.OPEN == door.state
    assert (
        None is _import(tmp_path / "office", path, replace(SCANS, since_ns=START - S)).first_event
    )


def test_driving_through_a_door_is_told_as_that(office: Path, tmp_path: Path) -> None:
    """From the corridor into the room, along a line across the door's."""
    room = LaserRoom(
        seconds=8.0, drive=lambda t: moved(4.45, -0.9 + 0.5 * t) @ turned("z", math.pi / 2)
    )
    write_mcap(tmp_path / "x.mcap", room.said())

    imported = _import(office, tmp_path / "x.mcap")

    (passed,) = _events(office, DoorPassed)
    assert (1, True) == (passed.door_id, passed.passed)
    assert START + 4 * S < passed.happened_ns < START + 8 * S
    assert "1 driven through, 0 undecided" in imported.plan.summary[-1]


def test_a_bag_without_localisation_is_refused_whole(office: Path, tmp_path: Path) -> None:
    """With the frames that there are, and what to do."""
    room = LaserRoom()
    said = [*room.statics(), *room.tf(localised=False), *room.scans()]
    contact = Said("/door_states", *Robot().door_state("front", 2), START)
    write_mcap(tmp_path / "x.mcap", [contact, *sorted(said, key=lambda each: each.at_ns)])

    with pytest.raises(FormatError) as refused:
        _import(office, tmp_path / "x.mcap")

    text = str(refused.value)
    assert "96 scans" in text
    assert "laser on base_link" in text
    assert "--pose-topic /amcl_pose" in text
    assert "a mapping file" not in text
    assert 1 == len(list(sl.read(office).commits()))


def test_a_map_of_another_name_and_poses_that_are_there_are_pointed_at(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And what is told to be written into a mapping file does help."""
    room = LaserRoom(seconds=2.0)
    said = sorted([*room.said(), *room.poses()], key=lambda each: each.at_ns)
    write_mcap(tmp_path / "x.mcap", said)
    mapping = tmp_path / "robot.yaml"
    mapping.write_text("well_known: true\nframes: {map: world}\n")

    assert 1 == _run("import", office, tmp_path / "x.mcap", "--scan", "--mapping", mapping)

    text = capsys.readouterr().err
    assert "--pose-topic /amcl_pose." in text
    assert "well_known: true, frames" in text


def test_a_laser_that_tf_does_not_hold_is_told_as_that(office: Path, tmp_path: Path) -> None:
    """Poses of the robot would not help: nothing tells where the laser is on it."""
    room = LaserRoom(seconds=2.0)
    said = sorted([*room.tf(), *room.scans(), *room.poses()], key=lambda each: each.at_ns)
    write_mcap(tmp_path / "x.mcap", said)

    with pytest.raises(FormatError, match="laser is in no transform") as refused:
        _import(office, tmp_path / "x.mcap")

    assert "/tf and /tf_static" in str(refused.value)
    assert "pose" not in str(refused.value)
    assert "mapping file" not in str(refused.value)


def test_an_import_without_scan_says_what_a_laser_would_bring(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Below the topics that are left out."""
    said = [Said("/door_states", *Robot().door_state("front", 2), START), *drives_by()]
    write_mcap(tmp_path / "x.mcap", said)

    assert 0 == _run("import", office, tmp_path / "x.mcap")

    assert "--scan" in capsys.readouterr().err


@pytest.mark.parametrize("topic", ["/tf", "/scan"])
def test_a_topic_of_poses_that_has_none_is_refused_with_those_there_are(
    topic: str, office: Path, tmp_path: Path
) -> None:
    """Before anything is read of it."""
    options = ImportOptions(scan=ScanOptions((), topic))

    with pytest.raises(FormatError, match=rf"expected a topic {topic} of geometry_msgs/Pose"):
        _import(office, _mcap(tmp_path), options)


def test_a_topic_of_poses_helps_a_bag_without_localisation(office: Path, tmp_path: Path) -> None:
    """As the refusal says."""
    room = LaserRoom()
    said = [*room.statics(), *room.tf(localised=False), *room.poses(), *room.scans()]
    write_mcap(tmp_path / "x.mcap", sorted(said, key=lambda each: each.at_ns))

    options = ImportOptions(scan=ScanOptions(pose_topic="/amcl_pose"))
    _import(office, tmp_path / "x.mcap", options)

    assert [DoorState.OPEN] == _states(office)
    assert {0.2} == {pose.sd_xy for pose in _events(office, RobotPose)}


def test_a_bag_that_is_damaged_leaves_the_log_as_it_is(office: Path, tmp_path: Path) -> None:
    """Also where its first visits could be read."""
    path = _mcap(tmp_path)
    data = bytearray(path.read_bytes())
    data[len(data) * 3 // 4] ^= 0xFF
    path.write_bytes(data)

    with pytest.raises(FormatError, match="damaged"):
        _import(office, path)

    assert 1 == len(list(sl.read(office).commits()))


@pytest.mark.parametrize(
    ("topics", "asked", "said"),
    [
        (["/front", "/rear"], (), r"it has several: /front, /rear; name those of different lasers"),
        (["/front"], ("/rear",), r"expected a topic /rear of sensor_msgs/LaserScan or .*there is"),
        ([], (), r"it has none; there is: /tf \(tf2_msgs/TFMessage\)"),
    ],
)
def test_which_laser_is_meant_has_to_be_clear(
    topics: list[str], asked: tuple[str, ...], said: str, office: Path, tmp_path: Path
) -> None:
    """The same beams under two names would count twice."""
    room = LaserRoom(seconds=1.0)
    sent = [room.sent(room.scan(0.5), 0.6, topic.strip("/")) for topic in topics]
    write_mcap(tmp_path / "x.mcap", [*room.tf(), *sent])

    with pytest.raises(FormatError, match=said):
        _import(office, tmp_path / "x.mcap", ImportOptions(scan=ScanOptions(asked)))


def test_of_several_lasers_the_one_called_scan_is_read(office: Path, tmp_path: Path) -> None:
    """Others beside it are its copies more often than not: filtered, merged."""
    copies = [
        replace(each, topic="/scan_filtered") for each in drives_by() if each.topic == "/scan"
    ]
    said = sorted([*drives_by(), *copies], key=lambda each: each.at_ns)
    write_mcap(tmp_path / "x.mcap", said)

    imported = _import(office, tmp_path / "x.mcap")

    assert 2 == len(_states(office))
    assert ["scans of /scan: 192, 192 on the map"] == list(imported.plan.summary[:1])


def test_two_lasers_of_a_robot_see_a_door_once(office: Path, tmp_path: Path) -> None:
    """The sighting names the one that saw most of it."""
    front = LaserRoom(state=lambda _: SHUT)
    rear = LaserRoom(
        state=lambda _: SHUT, laser_frame="rear", mount=moved(-0.2, 0) @ turned("z", math.pi)
    )
    said = [
        *front.said(), *rear.statics(),
        *(replace(each, topic="/rear/scan") for each in rear.scans()),
    ]  # fmt: skip
    write_mcap(tmp_path / "x.mcap", sorted(said, key=lambda each: each.at_ns))

    assert 0 == _run(
        "import", office, tmp_path / "x.mcap", "--scan", "/scan", "--scan", "/rear/scan"
    )

    seen = [(entry.source, entry.event.state)
            for entry in sl.read(office).history(kinds=[DoorObserved])]  # fmt: skip
    assert [("scan:laser leaf-likelihood", DoorState.CLOSED)] == seen


@pytest.fixture
def two_levels(tmp_path: Path) -> Path:
    """A log of two levels, the door of the room on the upper one."""
    x, y, theta, width = DOOR
    with sl.create(tmp_path / "office", tz="UTC", robot="tug1") as log:
        log.append([LevelAdded(level=n, name=f"L{n}", happened_ns=LONG_AGO) for n in (1, 2)])
        log.add_door(x=x, y=y, theta=theta, width=width, name="lab", level=2, at=LONG_AGO)
    return tmp_path / "office"


def test_a_log_of_several_levels_is_told_where_the_robot_drove(
    two_levels: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What the message says to do can be done: --level."""
    bag = _mcap(tmp_path)

    assert 1 == _run("import", two_levels, bag, "--scan")
    assert "1 (L1), 2 (L2); say which one: --level L" in (capsys.readouterr().err)
    assert 0 == _run("import", two_levels, bag, "--scan", "--level", "L2", "--dry-run")
    assert '"level": 2' in capsys.readouterr().out
    assert 0 == _run("import", two_levels, bag, "--scan", "--level", "L2")

    assert [DoorState.OPEN, DoorState.CLOSED] == _states(two_levels)
    assert {2} == {pose.level for pose in _events(two_levels, RobotPose)}


def test_a_level_is_that_of_the_topic_or_of_all(two_levels: Path, tmp_path: Path) -> None:
    """A topic's own level goes first, then that of the command line, then that of the file."""
    mapping, bag = tmp_path / "robot.yaml", _mcap(tmp_path)
    options = ImportOptions(mapping=mapping)
    mapping.write_text("level: L1\ntopics: {/scan: scan}\n")
    below = _import(two_levels, bag, options)
    assert any("1, the doors on level 2" in each for each in below.plan.warnings)
    assert [] == _states(two_levels)

    copy = Path(shutil.copytree(two_levels, tmp_path / "copy"))
    _import(two_levels, bag, replace(options, level="L2"))
    assert [DoorState.OPEN, DoorState.CLOSED] == _states(two_levels)

    mapping.write_text("level: L1\ntopics: {/scan: {read: scan, level: L2}}\n")
    _import(copy, bag, options)
    assert [DoorState.OPEN, DoorState.CLOSED] == _states(copy)


def test_a_report_and_proposals_are_of_the_level_that_is_told(
    two_levels: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As the import of the same bag."""
    bag = _mcap(tmp_path)

    assert 0 == _run("scan-report", two_levels, bag, "--level", "L2", "--json")
    (door,) = json.loads(capsys.readouterr().out)["doors"]
    assert (1, 1) == (door["open"], door["closed"])
    assert 0 == _run("import", two_levels, bag, "--scan", "--propose-doors", "--level", "2")
    assert "192 scans" in capsys.readouterr().err


@pytest.mark.parametrize("heights", ["0.3", "1.5,0.3", "a,b", "0.3,inf", "1,2,3"])
def test_heights_that_are_none_are_a_usage_error(
    heights: str, office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With what is expected."""
    assert 2 == _run("import", office, "x.bag", "--scan", "/points", "--heights", heights)

    assert f"as 0.3,1.5; got '{heights}'" in capsys.readouterr().err


def test_a_dry_run_shows_what_would_be_written_and_counts(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Events with their sources on stdout, counts on stderr; the log stays as it is."""
    path = _mcap(tmp_path)
    before = {each: each.read_bytes() for each in office.iterdir()}

    assert 0 == _run("import", office, path, "--scan", "--dry-run")

    out, err = capsys.readouterr()
    lines = [json.loads(line) for line in out.splitlines()]
    assert ["RobotPose", "RobotPose", "DoorObserved"] * 2 == [line["kind"] for line in lines]
    assert {"scan:laser leaf-likelihood"} == {line["source"] for line in lines}
    assert "6 events; nothing was written" in err
    assert "scans of /scan: 192, 192" in err
    assert "2 to 1 door: 1 OPEN, 1 CLOSED, 0" in err
    assert before == {each: each.read_bytes() for each in office.iterdir()}


def test_scan_stands_alone_or_before_a_topic_or_a_file(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What follows it is a topic if it can be one and is no file."""
    path = _mcap(tmp_path)

    for words in (
        ("--scan", path), ("--scan", "/scan", path), (path, "--scan"), (path, "--scan=/scan"),
        (path, "--scan", "--json"),
    ):  # fmt: skip
        assert 0 == _run("import", office, *words), words
    with TemporaryDirectory(prefix="patrol") as folder:  # whose name could be that of a topic
        write_ros2(Path(folder) / "bag", drives_by())
        assert re.fullmatch(r"(/\w+)+", folder)
        assert 0 == _run("import", office, "--scan", Path(folder) / "bag")

    assert 2 == _run("import", office, path, "--pose-topic", "/amcl_pose")
    assert 1 == _run("import", office, path, "--scan", "/rear")
    assert [DoorState.OPEN, DoorState.CLOSED] == _states(office)
    assert "expected a topic /rear" in capsys.readouterr().err


def test_since_when_doors_were_there_can_be_tried_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A dry run takes the line that the refusal tells, and shows the doors' earlier adding, too."""
    x, y, theta, width = DOOR
    office, path = tmp_path / "office", _mcap(tmp_path)
    with sl.create(office, tz="Europe/Vienna") as log:
        log.add_door(x=x, y=y, theta=theta, width=width)

    assert 1 == _run("import", office, path, "--scan")
    line = capsys.readouterr().err.partition("say so: ")[2]
    assert 0 == _run(*shlex.split(line)[1:], "--dry-run")
    kinds = [json.loads(text)["kind"] for text in capsys.readouterr().out.splitlines()]
    assert ["Retracted", "DoorAdded"] == kinds[:2]
    assert ["DoorObserved"] * 2 == [kind for kind in kinds if kind.startswith("DoorO")]
    assert 1 == len(list(sl.read(office).commits()))
    assert 0 == _run(*shlex.split(line)[1:])
    assert 2 == len(_states(office))
    assert 2 == _run("import", office, path, "--scan", "--since-ever")


def test_static_transforms_count_from_the_beginning(office: Path, tmp_path: Path) -> None:
    """A bag has them where they were sent, which may be behind the first scans."""
    said = [each for each in drives_by() if each.topic != "/tf_static"]
    (fixed, *_) = LaserRoom().statics()
    late = replace(fixed, at_ns=START + 70 * S)
    write_mcap(tmp_path / "x.mcap", sorted([*said, late], key=lambda each: each.at_ns))

    imported = _import(office, tmp_path / "x.mcap")

    assert "scans of /scan: 192, 192 on the map" in imported.plan.summary
    assert TRANSFORMS == late.ros_type


def test_a_robot_that_drove_through_did_so_once(office: Path, tmp_path: Path) -> None:
    """Whichever of its two lasers told it, in whatever order they are imported."""

    def drive(t: float) -> Any:
        made = turned("z", math.pi / 2)
        made[:2, 3] = 4.45, -0.6 + 0.4 * t
        return made

    rooms = [
        LaserRoom(seconds=9.0, drive=drive, laser_frame=name, mount=moved(x, 0.0, 0.3))
        for name, x in (("front", 0.2), ("rear", -0.2))
    ]
    said = [*rooms[0].statics(), *rooms[1].statics(), *rooms[0].tf()]
    for room in rooms:
        said += [replace(each, topic=f"/{room.laser_frame}/scan") for each in room.scans()]
    write_mcap(tmp_path / "x.mcap", sorted(said, key=lambda each: each.at_ns))

    for topics in (["/rear/scan"], ["/front/scan", "/rear/scan"], ["/front/scan"]):
        _import(office, tmp_path / "x.mcap", ImportOptions(scan=ScanOptions(tuple(topics))))

    assert ["rear"] == [
        entry.source.split()[0].removeprefix("scan:")
        for entry in sl.read(office).history(kinds=[DoorPassed])
    ]


def test_looks_that_somebody_imported_in_his_name_count_once(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a bag that begins before another one ends, both by the same person; a dry run says so."""
    said, bob = drives_by(), Note(actor="bob")
    one, other = tmp_path / "one.mcap", tmp_path / "other.mcap"
    write_mcap(one, said[: len(said) // 2 + 20])
    write_mcap(other, said)
    with sl.append(office) as log:
        import_file(log, one, SCANS, note=bob)

    assert 0 == _run("import", office, other, "--scan", "--dry-run", "--actor", "bob")
    shown = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    with sl.append(office) as log:
        import_file(log, other, SCANS, note=bob)

    assert ["CLOSED"] == [each["state"] for each in shown if each["kind"] == "DoorObserved"]
    assert [DoorState.OPEN, DoorState.CLOSED] == _states(office)
