"""`record --scan`: what a laser sees while it drives, in memory and on a real ROS."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, RobotPose
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.importing.scan_topics import ScanOptions
from semmap_log.interop.topics.lasers import scan_keeper
from semmap_log.interop.topics.lasers.scan_keeper import ScanWatch
from semmap_log.interop.topics.topic_reader import Known
from semmap_log.interop.topics.topic_rules import WELL_KNOWN, ReadScan, RosMapping
from semmap_log.live.ros import ros_recorder
from semmap_log.live.ros.ros_recorder import LogSink, PrintedSink, RosRecorder
from tests.interop.formats.bags.bags_of_others import Said, write_mcap
from tests.interop.topics.laser_room import DOOR, SHUT, LaserRoom, drives_by
from tests.interop.topics.robots import START, Robot, S
from tests.interop.topics.test_scans_placed import Hearing
from tests.live.ros.memory_node import MemoryNode
from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running, wait_until
from tests.live.ros.test_record_ros import Talker, _talking

SCANS = replace(WELL_KNOWN, scans=ReadScan())
LONG_AGO = START - 3600 * S


def _office(path: Path, **door: Any) -> Path:
    x, y, theta, width = DOOR
    with sl.create(path, tz="UTC", robot="tug1", compact=False) as log:
        log.add_door(x=x, y=y, theta=theta, width=width, name="lab", at=LONG_AGO)
    return path


def _recorded(path: Path, said: Iterable[Said], mapping: RosMapping = SCANS) -> RosRecorder:
    """Record what is said; all of its topics are there from the start."""
    all_said = list(said)

    def during(node: MemoryNode) -> None:
        for each in all_said:
            if each.topic in node.takers:  # others nobody hears
                node.say(each)

    node = MemoryNode(during, {each.topic: each.ros_type for each in all_said})
    with sl.append(path, durability="none", compact=False) as log:
        recorder = RosRecorder(node, mapping, LogSink(log), lambda _: None)  # type: ignore[arg-type]
        recorder.run()
    return recorder


def _events(path: Path) -> list[str]:
    batches = sl.read(path).batches(kinds=[DoorObserved, RobotPose])
    return [repr(each.event) for batch in batches for each in batch]


def test_live_or_from_a_bag_the_sightings_are_the_same(tmp_path: Path) -> None:
    """States, accuracies, openings, times, poses; and both say who saw it with what."""
    said = drives_by()
    live, imported = (_office(tmp_path / name) for name in ("live", "imported"))
    write_mcap(tmp_path / "x.mcap", said)
    with sl.append(imported) as log:
        import_file(log, tmp_path / "x.mcap", ImportOptions(scan=ScanOptions()))

    recorder = _recorded(live, said)

    assert 6 == len(_events(live))
    assert _events(imported) == _events(live)
    assert (192, 2) == (recorder.counts.scans, recorder.counts.visits)
    notes = {
        (entry.actor, entry.source)
        for log in (live, imported)
        for entry in sl.read(log).history(kinds=[DoorObserved])
    }
    assert {("tug1", "scan:laser leaf-likelihood")} == notes
    assert any("1 OPEN, 1 CLOSED" in line for line in recorder.summary())


def test_the_bag_of_a_drive_that_was_recorded_adds_nothing(tmp_path: Path) -> None:
    """They are the same looks."""
    said, live = drives_by(), _office(tmp_path / "live")
    write_mcap(tmp_path / "x.mcap", said)
    _recorded(live, said)
    before = _events(live)

    with sl.append(live) as log:
        imported = import_file(log, tmp_path / "x.mcap", ImportOptions(scan=ScanOptions()))

    assert None is imported.first_event
    assert before == _events(live)


def test_a_clock_that_is_set_back_costs_no_scan(tmp_path: Path) -> None:
    """The door is seen on, though the clock needs an hour until it is where it was."""
    office = _office(tmp_path / "office")
    hour = LaserRoom(begins_s=3600.0, state=lambda _: SHUT)

    recorder = _recorded(office, [*hour.said(), *LaserRoom().said()])

    assert (192, 2) == (recorder.counts.scans, recorder.counts.visits)
    kinds = [line.partition("(")[0] for line in _events(office)]
    assert ["RobotPose", "RobotPose", "DoorObserved"] * 2 == kinds
    assert any("a clock was set" in line for line in recorder.summary())


def test_the_visits_of_a_laser_that_falls_silent_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are written while it records on: neither a next scan is waited for nor any message."""
    monkeypatch.setattr(scan_keeper, "QUIET_S", 0.3)
    monkeypatch.setattr(ros_recorder, "QUIET_LOOK_S", 0.05)
    office, seen = _office(tmp_path / "office"), []

    def during(node: MemoryNode) -> None:
        for each in LaserRoom().said():
            node.say(each)
        wait_until(lambda: len(_events(office)) > 0, "a sighting while nothing comes")
        seen.extend(_events(office))

    node = MemoryNode(during, {each.topic: each.ros_type for each in LaserRoom(seconds=1).said()})
    with sl.append(office, durability="flush", compact=False) as log:
        RosRecorder(node, SCANS, LogSink(log), lambda _: None).run()  # type: ignore[arg-type]

    assert any(line.startswith("DoorObserved") for line in seen)


def test_only_the_robot_that_is_silent_ends_its_visits() -> None:
    """Half a minute after its last scan, though another one goes on; and once."""
    x, y, theta, width = DOOR
    known = Known()
    known.apply(DoorAdded(door_id=DoorId(1), x=x, y=y, theta=theta, width=width))
    now_s = [1000.0]
    watch = ScanWatch(known, "tug1", clock=lambda: now_s[0])
    one, two = (
        [replace(each, scan=replace(each.scan, robot=robot))
         for each in Hearing(SCANS).hear(LaserRoom(seconds=6.0).said())]
        for robot in ("one", "two")
    )  # fmt: skip
    watch.add([*one, *two])
    assert [] == list(watch.take())

    now_s[0] += 29.9
    watch.add(two[-1:])
    assert [] == list(watch.take())
    now_s[0] += 0.1

    assert ["one"] == [commit.visit.robot for commit in watch.take()]
    assert [] == list(watch.take())
    assert ["two"] == [commit.visit.robot for commit in watch.close()]


def test_a_door_that_comes_while_it_records_is_seen_from_then_on(tmp_path: Path) -> None:
    """A server's DoorMap adds it between two drives."""
    sl.create(tmp_path / "office", tz="UTC", compact=False).close()
    x, y, theta, width = DOOR
    door = {"door_id": 7, "pos_x": x, "pos_y": y, "pos_theta": theta, "width": width}
    server = Said("/doors", *Robot().door_map([door]), START + 30 * S)
    said = sorted([server, *drives_by()], key=lambda each: each.at_ns)

    _recorded(tmp_path / "office", said)

    (seen,) = [
        each.event for batch in sl.read(tmp_path / "office").batches(kinds=[DoorObserved])
        for each in batch
    ]  # fmt: skip
    assert isinstance(seen, DoorObserved)
    assert (7, DoorState.CLOSED) == (seen.door_id, seen.state)


def test_a_door_that_is_removed_while_it_is_looked_at_is_told_up_to_then(tmp_path: Path) -> None:
    """And nothing is said of it afterwards."""
    office = _office(tmp_path / "office")
    x, y, theta, width = DOOR
    door = {"door_id": 1, "pos_x": x, "pos_y": y, "pos_theta": theta, "width": width}
    server = [
        Said("/doors", *Robot().door_map([door]), START + S),
        Said("/doors", *Robot().door_map([]), START + 9 * S),
    ]
    recorder = _recorded(
        office, sorted([*server, *LaserRoom().said()], key=lambda each: each.at_ns)
    )

    assert [] == [line for line in recorder.summary() if "forbids" in line]
    assert 0 == len(sl.read(office).replay())
    seen = [line for line in _events(office) if line.startswith("DoorObserved")]
    assert 1 == len(seen)


def test_scans_are_not_read_unless_asked_for(tmp_path: Path) -> None:
    """Nor TF, whose messages are many."""
    office = _office(tmp_path / "office")

    recorder = _recorded(office, LaserRoom(seconds=2.0).said(), WELL_KNOWN)

    assert [] == _events(office)
    assert (0, 0) == (recorder.counts.received, recorder.counts.scans)


def test_a_dry_run_shows_sightings_with_their_sources(tmp_path: Path) -> None:
    office, shown = _office(tmp_path / "office"), []

    def during(node: MemoryNode) -> None:
        for each in LaserRoom().said():
            node.say(each)

    node = MemoryNode(during, {each.topic: each.ros_type for each in LaserRoom(seconds=1).said()})
    sink = PrintedSink(lambda event, note: shown.append((event, note.source)), sl.read(office))
    RosRecorder(node, SCANS, sink, lambda _: None).run()  # type: ignore[arg-type]

    assert ["RobotPose", "RobotPose", "DoorObserved"] == [type(e).__name__ for e, _ in shown]
    assert {"scan:laser leaf-likelihood"} == {source for _, source in shown}
    assert [] == _events(office)


def test_a_laser_on_a_real_ros_sees_a_door(ros: RosWorld, tmp_path: Path) -> None:
    """/scan, /tf and a latched /tf_static, as a robot publishes them, now; Ctrl-C ends a visit."""
    office = _office(tmp_path / "office")

    with _talking(ros) as talker, ros.semmap("record", office, ros.option, "--scan") as recorder:
        _drive_by(ros, talker, recorder)
        time.sleep(1.0)
        assert 0 == recorder.stop()

    wait_until(lambda: len(_events(office)) > 0, "a sighting")
    (seen,) = [
        each.event for batch in sl.read(office).batches(kinds=[DoorObserved]) for each in batch
    ]
    assert isinstance(seen, DoorObserved)
    assert (1, DoorState.OPEN) == (seen.door_id, seen.state)
    (entry,) = sl.read(office).history(kinds=[DoorObserved])
    assert ("tug1", "scan:laser leaf-likelihood") == (entry.actor, entry.source)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL], ids=["SIGTERM", "SIGKILL"])
def test_a_recorder_that_is_ended_amid_a_visit_leaves_a_whole_log(
    ros: RosWorld, tmp_path: Path, number: int
) -> None:
    """SIGTERM ends the visit, and it is written with its scans; SIGKILL loses it whole."""
    office = _office(tmp_path / "office")
    words = ("record", office, ros.option, "--scan", "--keep-scans")

    with _talking(ros) as talker:
        with ros.semmap(*words) as recorder:
            _drive_by(ros, talker, recorder, seconds=6.0)
            time.sleep(1.0)
            code = recorder.stop(number)
        told = [line.partition("(")[0] for line in _events(office)]
        with ros.semmap(*words) as again:
            again.wait_for("/scan: recording")
            assert 0 == again.stop()

    is_told = number == signal.SIGTERM
    assert code == (0 if is_told else -signal.SIGKILL)
    assert told == (["RobotPose", "RobotPose", "DoorObserved"] if is_told else [])
    for verb in ("verify", "info", "replay", "history", "timeline", "probabilities"):
        answered = ros.semmap(verb, office, *(["lab"] if verb == "timeline" else []))
        assert 0 == answered.wait(), answered
    report = ros.semmap("scan-report", office)
    assert report.wait() == (0 if is_told else 1), report.output + report.errors


def _drive_by(ros: RosWorld, talker: Talker, recorder: Running, *, seconds: float = 12.0) -> None:
    """Have a robot publish /scan, /tf and a latched /tf_static, now, as it drives by the door."""
    version: Any = 1 if ros.version == 1 else 2
    room = LaserRoom(version=version, beams=180, scan_hz=5.0, tf_hz=10.0, seconds=seconds)
    room.begins_s = (time.time_ns() - START) / S
    (fixed, *_) = room.statics()
    talker.say("/tf_static", (fixed.ros_type, fixed.data), latched=True)
    (first, *_) = room.tf()
    talker.say("/tf", (first.ros_type, first.data))
    talker.say("/scan", _of(room, 0.0))
    for topic in ("/scan", "/tf", "/tf_static"):
        recorder.wait_for(f"{topic}: recording")
    talker.wait()
    room.begins_s = (time.time_ns() - START) / S
    for each in room.said():
        if each.topic != "/tf_static":
            time.sleep(max(0.0, (each.at_ns - time.time_ns()) / S))
            talker.say(each.topic, (each.ros_type, each.data))
    talker.wait()


def _of(room: LaserRoom, t: float) -> tuple[str, bytes]:
    sent = room.sent(room.scan(t), t)
    return sent.ros_type, sent.data


@pytest.mark.parametrize("topic", ["/r1/scan", "/scan"])
def test_only_topics_called_scan_are_read_where_none_is_named(topic: str) -> None:
    """A filtered copy beside them would be seen as another laser."""
    laser = "sensor_msgs/msg/LaserScan"

    assert SCANS.rule(topic, laser) is not None
    assert SCANS.rule("/scan_filtered", laser) is None
    assert SCANS.rule(topic, "std_msgs/msg/Bool") is None
    assert WELL_KNOWN.rule(topic, laser) is None
