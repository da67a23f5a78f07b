"""The recorder on a node in memory: the queue, the writer, topics that come late, a full disk."""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.model.commits import MOST_NOTE_CHARACTERS, Note
from semmap_log.core.model.events import DoorRequested, Event, LevelAdded
from semmap_log.errors import CommandError, FormatError, LogPoisonedError, RosError
from semmap_log.interop.importing.importing import ImportOptions, import_file, plan_bag_import
from semmap_log.interop.topics.topic_reader import Known
from semmap_log.interop.topics.topic_rules import (
    WELL_KNOWN,
    ReadDoorMap,
    ReadRmfRequest,
    ReadRmfState,
    ReadSensor,
    RosMapping,
    TopicRule,
)
from semmap_log.live.ros import ros_recorder
from semmap_log.live.ros.ros_recorder import MOST_AT_ONCE, LogSink, RosRecorder
from tests.interop.formats.bags.bags_of_others import Said, write_mcap
from tests.interop.topics.robots import START, Robot, S
from tests.live.ros.memory_node import MemoryNode
from tests.live.ros.running import wait_until

ROBOT = Robot()


def _recorder(
    node: MemoryNode, sink: Any, mapping: RosMapping = WELL_KNOWN
) -> tuple[RosRecorder, list[str]]:
    told: list[str] = []
    return RosRecorder(node, mapping, sink, told.append), told  # type: ignore[arg-type]


_MESSAGES = st.lists(
    st.tuples(st.sampled_from("ab"), st.integers(0, 5), st.integers(0, 90))
    | st.dictionaries(st.integers(1, 3), st.floats(-1, 3), max_size=3),
    max_size=20,
)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(_MESSAGES)
def test_live_or_from_a_bag_the_events_are_the_same(drawn: list[Any]) -> None:
    """Of any stream of messages, good and bad: happened times, values, order, complaints."""
    said, at_ns = [], START
    for each in drawn:
        if isinstance(each, dict):
            doors = [{"door_id": n, "width": width} for n, width in each.items()]
            said.append(Said("/doors", *ROBOT.door_map(doors), at_ns))
        else:
            name, mode, later_s = each
            at_ns += later_s * S
            said.append(Said("/door_states", *ROBOT.door_state(name, mode, at_ns), at_ns))

    def during(node: MemoryNode) -> None:
        for each in said:
            node.say(each)

    with TemporaryDirectory() as folder:
        for name in ("live", "imported"):
            sl.create(Path(folder) / name, tz="UTC", compact=False).close()
        with sl.append(Path(folder) / "live", durability="none", compact=False) as log:
            node = MemoryNode(during, {"/doors": "lta_semantic_map/msg/DoorMap"})
            recorder, _ = _recorder(node, LogSink(log))
            recorder.run()
        warnings: tuple[str, ...] = ()
        if said:
            write_mcap(Path(folder) / "x.mcap", said)
            with sl.append(Path(folder) / "imported", compact=False) as log:
                options = ImportOptions()
                warnings = plan_bag_import(log, Path(folder) / "x.mcap", options).warnings
                with suppress(FormatError):  # nothing of it is an event
                    import_file(log, Path(folder) / "x.mcap")

        assert _events(Path(folder) / "imported") == _events(Path(folder) / "live")
    assert warnings == recorder.summary()
    assert (len(said), 0) == (recorder.counts.messages, recorder.counts.dropped)


def _events(path: Path) -> list[str]:
    return [repr(each.event) for batch in sl.read(path).batches() for each in batch]


def test_a_topic_that_is_published_late_is_found(tmp_path: Path) -> None:
    """One whose type the mapping does not tell is subscribed to as soon as somebody offers it."""
    name, data = ROBOT.said("Bool", True)
    mapping = RosMapping({"/contact": TopicRule(ReadSensor("front"))})

    def during(node: MemoryNode) -> None:
        assert node.tick is not None
        node.tick()
        assert "/contact" not in node.takers
        node.published["/contact"] = name
        recorder._next_look = 0.0
        node.tick()
        node.say(Said("/contact", name, data, START))

    with sl.create(tmp_path / "log", tz="UTC") as log:
        recorder, told = _recorder(MemoryNode(during), LogSink(log), mapping)
        recorder.run()

    assert ["/contact: recording (std_msgs/Bool)"] == told
    assert 3 == recorder.counts.events


def test_a_type_that_is_not_installed_is_told_once(tmp_path: Path) -> None:
    """Its topic is left out, the recorder runs."""
    mapping = RosMapping({"/odd": TopicRule(ReadSensor("front"), "odd_msgs/msg/Odd")})
    node = MemoryNode(lambda _: None, {"/odd": "odd_msgs/msg/Odd"})

    with sl.create(tmp_path / "log", tz="UTC") as log:
        recorder, told = _recorder(node, LogSink(log), mapping)
        recorder.run()

    assert ["/odd: left out: odd_msgs is not there; install it"] == told


def test_a_message_that_no_log_takes_is_left_out_and_the_others_are_stored(tmp_path: Path) -> None:
    """A name of whoever asks that is longer than a note may be: complained about, once."""

    def during(node: MemoryNode) -> None:
        node.say(Said("/door_states", *ROBOT.door_state("front", 2, START), START))
        for who in ("x" * (MOST_NOTE_CHARACTERS + 1), "eva"):
            node.say(Said("/door_requests", *ROBOT.door_request("front", 0, who), START + S))

    with sl.create(tmp_path / "log", tz="UTC") as log:
        recorder, told = _recorder(MemoryNode(during), LogSink(log))
        recorder.run()

    entries = list(sl.read(tmp_path / "log").history(kinds=[DoorRequested]))
    assert ["eva"] == [entry.actor for entry in entries]
    assert 1 == sum(
        "events that the map forbids; left out: Note: expected" in each for each in told
    )


def test_what_comes_too_fast_for_the_disk_is_dropped_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The newest messages go, and it is said; what waited is written."""
    monkeypatch.setattr(ros_recorder, "MOST_WAITING", 10)
    goes_on = threading.Event()

    class SlowSink(LogSink):
        def write(self, events: list[Event], note: Note) -> None:
            goes_on.wait(100)
            super().write(events, note)

    def during(node: MemoryNode) -> None:
        for n in range(50):
            node.say(Said("/door_states", *ROBOT.door_state(f"door{n}", 2), START + n))
        goes_on.set()

    with sl.create(tmp_path / "log", tz="UTC") as log:
        recorder, _ = _recorder(MemoryNode(during), SlowSink(log))
        recorder.run()
        doors = len(log.replay())

    assert recorder.counts.messages + recorder.counts.dropped == recorder.counts.received == 50
    assert doors == recorder.counts.messages < 13
    assert "DROPPED (the disk is too slow)" in str(recorder.counts)


def test_what_was_received_is_written_though_the_recorder_was_told_to_stop(tmp_path: Path) -> None:
    """All that came before, however much waits for the disk: more than share a sync, too."""
    told_to_stop = threading.Event()

    class SlowSink(LogSink):
        def write(self, events: list[Event], note: Note) -> None:
            told_to_stop.wait(100)
            super().write(events, note)

    def during(node: MemoryNode) -> None:
        for n in range(MOST_AT_ONCE + 500):
            node.say(Said("/door_states", *ROBOT.door_state("door", n % 2 * 2), START + n))
        recorder.stopping = True
        told_to_stop.set()

    with sl.create(tmp_path / "log", tz="UTC", durability="none") as log:
        recorder, _ = _recorder(MemoryNode(during), SlowSink(log))
        recorder.run()

    count = MOST_AT_ONCE + 500
    assert (count, count) == (recorder.counts.messages, recorder.counts.commits)


@pytest.mark.parametrize(("durability", "synced"), [("event", 1), ("none", 0)])
def test_messages_that_wait_share_a_sync(
    durability: str, synced: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of those that a disk has to hold at once; without that promise there is none."""
    syncs: list[int] = []
    real = os.fdatasync

    with sl.create(tmp_path / "log", tz="UTC", durability=durability) as log:
        monkeypatch.setattr(os, "fdatasync", lambda fd: syncs.append(fd) or real(fd))
        sink = LogSink(log)
        for n in range(20):
            sink.write([LevelAdded(level=n, name=f"L{n}")], Note())
        before = len(syncs)
        sink.settle()
        after = len(syncs)
        monkeypatch.undo()

    assert (0, synced) == (before, after)


def test_a_write_that_fails_ends_the_recording(tmp_path: Path) -> None:
    """The node is left, and the error is that of the log."""

    class FullDisk(LogSink):
        def write(self, events: list[Event], note: Note) -> None:
            raise LogPoisonedError("no space left")

    def during(node: MemoryNode) -> None:
        node.say(Said("/door_states", *ROBOT.door_state("a", 2), START))
        with suppress(AssertionError):
            stops.append(wait_until(node.stop, "the node is told to stop"))

    stops: list[bool] = []
    node = MemoryNode(during)

    with sl.create(tmp_path / "log", tz="UTC") as log:
        recorder, _ = _recorder(node, FullDisk(log))
        with pytest.raises(LogPoisonedError, match="no space left"):
            recorder.run()

    assert [True] == stops
    assert node.is_closed


def test_what_the_map_forbids_is_told_and_the_log_looked_at_again(tmp_path: Path) -> None:
    """Nothing of it is taken for known: the next message brings it again."""

    class Strict(LogSink):
        refused = 0

        def write(self, events: list[Event], note: Note) -> None:
            if not self.refused:
                self.refused = 1
                raise CommandError("not now")
            super().write(events, note)

    message = ROBOT.door_map([{"door_id": 1}])

    def during(node: MemoryNode) -> None:
        for n in range(3):
            node.say(Said("/doors", *message, START + n))

    mapping = RosMapping({"/doors": TopicRule(ReadDoorMap())})
    with sl.create(tmp_path / "log", tz="UTC") as log:
        recorder, told = _recorder(MemoryNode(during), Strict(log), mapping)
        recorder.run()
        known = Known.of(log)

    assert [1] == list(known.doors)
    assert (3, 1) == (recorder.counts.messages, recorder.counts.commits)
    assert any("events that the map forbids; left out: not now" in text for text in told)


def test_a_level_that_is_not_there_is_told_before_anything_is_recorded(tmp_path: Path) -> None:
    """With the topic that names it."""
    mapping = RosMapping({"/doors": TopicRule(ReadDoorMap(level="attic"))})

    with sl.create(tmp_path / "log", tz="UTC") as log:
        node = MemoryNode(lambda _: None)
        recorder, told = _recorder(node, LogSink(log), mapping)
        with pytest.raises(CommandError, match="/doors: no level 'attic'"):
            recorder.run()

    assert ([], {}, True) == (told, node.takers, node.is_closed)


@pytest.mark.parametrize("name", ["/", "/a b", "//a", "/a/", "/ä", "/a:=b", "/1a"])
def test_a_name_that_ros_cannot_have_is_told_before_anything_is_recorded(
    tmp_path: Path, name: str
) -> None:
    """ROS 1 would warn and wait for ever, rclpy raises what only its authors understand."""
    mapping = RosMapping({name: TopicRule(ReadSensor("front"))})

    with sl.create(tmp_path / "log", tz="UTC") as log:
        node = MemoryNode(lambda _: None)
        recorder, _ = _recorder(node, LogSink(log), mapping)
        with pytest.raises(CommandError, match="expected a topic's name as ROS 2 has them"):
            recorder.run()

    assert node.is_closed


def test_a_topic_that_comes_late_and_cannot_be_read_ends_nothing(tmp_path: Path) -> None:
    """A second DoorMap in a log of two levels is left out, aloud."""
    rules = {
        "/lta_semantic_map_door_db": TopicRule(ReadDoorMap(level="0")),
        "/door_states": TopicRule(ReadRmfState(level="1")),
        "/door_requests": TopicRule(ReadRmfRequest(level="1")),
    }
    mapping = RosMapping(rules, well_known=True)

    def during(node: MemoryNode) -> None:
        assert node.tick is not None
        node.published["/doors"] = "lta_semantic_map/msg/DoorMap"
        for _ in range(2):
            recorder._next_look = 0.0
            node.tick()
        node.say(Said("/door_states", *ROBOT.door_state("lab", 2), START))

    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([LevelAdded(level=n, name=f"floor {n}") for n in (0, 1)])
        recorder, told = _recorder(MemoryNode(during), LogSink(log), mapping)
        recorder.run()
        doors = len(log.replay())

    assert 1 == doors
    assert 1 == len([text for text in told if text.startswith("left out: /doors: ")])


def test_while_ros_does_not_answer_it_goes_on(tmp_path: Path) -> None:
    """As while ROS 1's master is away: told once, and once more when it is back."""
    mapping = RosMapping({"/states": TopicRule(ReadRmfState(), "rmf_door_msgs/msg/DoorState")})

    class Alone(MemoryNode):
        is_away = False

        def topics(self) -> dict[str, str]:
            if self.is_away:
                raise RosError("the master does not answer")
            return super().topics()

    def during(node: MemoryNode) -> None:
        assert isinstance(node, Alone)
        assert node.tick is not None
        for node.is_away in (True, True, False, False):
            recorder._next_look = 0.0
            node.tick()
            node.say(Said("/states", *ROBOT.door_state("lab", 2), START))

    with sl.create(tmp_path / "log", tz="UTC") as log:
        recorder, told = _recorder(Alone(during), LogSink(log), mapping)
        recorder.run()

    assert 4 == recorder.counts.messages
    assert ["the master does not answer", "ROS answers again."] == told[1:]
