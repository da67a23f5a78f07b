"""A log as messages in a bag: whatever moment a player goes to, it shows what a replay gives."""

from __future__ import annotations

import math
import re
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorMap, reduced
from semmap_log.core.model.events import DoorAdded, RobotPose
from semmap_log.errors import FormatError, MomentError, OutputError
from semmap_log.interop.exporting import stream as stream_module
from semmap_log.interop.exporting.log_files import record_bag
from semmap_log.interop.exporting.stream import StreamOptions, log_stream
from semmap_log.interop.formats.ros.ros_types import RosVersion
from semmap_log.views.palette import COLOUR_BLIND
from tests.conftest import SteadyClock
from tests.interop.exporting.lively import lively_log, seen, seen_in, some_moments
from tests.interop.formats.bags.marked import doors_in, shown_after
from tests.interop.formats.bags.played import Played, played
from tests.views.rerun.some_logs import SECOND, START, small_log

BAGS = ["x.mcap", "x.bag", "x"]
DOORS = "/semmap/doors"
THESIS = "/lta_semantic_map_door_db"

MARKED = StreamOptions(markers=True)


def topic(messages: list[Played], name: str, until_ns: int | None = None) -> list[Played]:
    """Return a topic's messages up to a moment."""
    return [m for m in messages if m.topic == name and (until_ns is None or m.at_ns <= until_ns)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [("x.mcap", 1), ("x.bag", 2), ("x", 3)])
def test_whoever_played_from_the_start_sees_what_a_replay_gives(
    name: str, seed: int, tmp_path: Path
) -> None:
    """Late and retracted events, names, moves between levels, removals and heights included."""
    log = lively_log(tmp_path / "log", seed=seed)
    moments = some_moments(log, seed)

    record_bag(log, tmp_path / name, MARKED)

    messages = played(tmp_path / name)
    for level in (1, 2):
        for moment in moments:
            arrays = [m.message for m in topic(messages, f"{DOORS}/level_{level}", moment)]
            expected = seen_in(log.replay(at=moment), level)
            assert expected == doors_in(shown_after(arrays))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 6))
def test_whoever_jumps_to_a_moment_sees_the_same(seed: int, tmp_path: Path) -> None:
    """The last message of each topic alone shows all doors: players load no more of them."""
    log = lively_log(tmp_path / "log", seed=seed)

    record_bag(log, tmp_path / "x.mcap", MARKED)

    messages = played(tmp_path / "x.mcap")
    shown = dict.fromkeys((1, 2), 0)
    for moment in some_moments(log, seed):
        now = log.replay(at=moment)
        for level in (1, 2):
            (last,) = topic(messages, f"{DOORS}/level_{level}", moment)[-1:] or [None]
            found = doors_in(shown_after([last.message])) if last else {}
            assert seen_in(now, level) == found
            shown[level] += len(found)
    assert min(shown.values()) > 10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options"), [("x.mcap", StreamOptions()), ("x.bag", MARKED), ("x", MARKED)]
)
def test_the_thesis_message_is_the_door_database(
    name: str, options: StreamOptions, tmp_path: Path
) -> None:
    """The last message of a moment lists the placed doors, ids ascending; NaN is "not given"."""
    log = lively_log(tmp_path / "log", seed=1)

    record_bag(log, tmp_path / name, options)

    messages = played(tmp_path / name)
    for moment in [*some_moments(log, seed=1), *(message.at_ns for message in messages)]:
        (last,) = topic(messages, THESIS, moment)[-1:]
        np.testing.assert_equal(database(log.replay(at=moment)), entries(last.message))


def database(door_map: DoorMap) -> list[tuple[Any, ...]]:
    """Return the doors that have a place as the thesis lists them."""
    return [
        (d.door_id, d.x, d.y, d.theta, d.width, reduced(d.state).name, d.prob_open, d.prob_closed)
        for d in door_map.doors.values()
        if d.is_placed
    ]


def entries(message: Any) -> list[tuple[Any, ...]]:
    """Return the entries of a DoorMap."""
    return [
        (e.door_id, e.pos_x, e.pos_y, e.pos_theta, e.width, e.door_state, e.prob_open,
         e.prob_closed)
        for e in message.door_db
    ]  # fmt: skip


@pytest.mark.slow
def test_without_markers_the_other_topics_are_the_same(tmp_path: Path) -> None:
    """Message by message, at each change, however many there are: markers only come in between."""
    log = lively_log(tmp_path / "log", seed=3)

    record_bag(log, tmp_path / "plain.mcap")
    record_bag(log, tmp_path / "marked.mcap", MARKED)

    plain = [str(m) for m in played(tmp_path / "plain.mcap")]
    shown = {DOORS, "/semmap/events"}
    assert len(plain) > 100
    assert plain == [
        str(m) for m in played(tmp_path / "marked.mcap") if not m.topic.startswith(tuple(shown))
    ]


@pytest.mark.parametrize("version", [1, 2])
def test_both_ros_take_the_names_of_the_topics(version: RosVersion, tmp_path: Path) -> None:
    """Of several levels, too: in ROS 2 no part of a name begins with a digit."""
    log = lively_log(tmp_path / "log", seed=1)

    stream = log_stream(log, MARKED, ros_version=version)

    names = [topic.name for topic in stream.topics]
    assert len(names) == len(set(names)) > 6
    assert all(re.fullmatch(r"(/[A-Za-z_][A-Za-z0-9_]*)+", name) for name in names)


def test_a_default_stands_for_probabilities_that_were_not_given(tmp_path: Path) -> None:
    """And for those alone."""
    log = small_log(tmp_path / "log")

    record_bag(log, tmp_path / "x.mcap", StreamOptions(markers=True, default_prob=0.125))

    first = topic(played(tmp_path / "x.mcap"), THESIS)[1].message
    assert [(0.25, 0.75), (0.125, 0.125)] == [(e.prob_open, e.prob_closed) for e in first.door_db]


@pytest.mark.slow
def test_each_change_is_sent_once(tmp_path: Path) -> None:
    """No message is the same as the one before it, and each has the time of an event."""
    log = lively_log(tmp_path / "log", seed=4)
    times = {min(e.happened_ns, e.recorded_ns) for e in log.history()}

    record_bag(log, tmp_path / "x.mcap", MARKED)

    messages = played(tmp_path / "x.mcap")
    assert {m.at_ns for m in messages} <= times
    for name in (f"{DOORS}/level_1", f"{DOORS}/level_2", THESIS):
        sent = [str(m.message) for m in topic(messages, name)]
        assert len(sent) > 20
        assert all(one != other for one, other in pairwise(sent))


@pytest.mark.slow
def test_with_an_interval_the_last_message_is_at_most_so_old(tmp_path: Path) -> None:
    """Each shows what was true at its own time, they keep their distance, and the end is shown."""
    log = lively_log(tmp_path / "log", seed=5)
    every = 3600 * SECOND

    done = record_bag(log, tmp_path / "x.mcap", StreamOptions(markers=True, every_s=3600))

    messages = played(tmp_path / "x.mcap")
    assert sorted(m.at_ns for m in messages) == [m.at_ns for m in messages]
    assert 3600 == done.every_s
    for level in (1, 2):
        arrays = topic(messages, f"{DOORS}/level_{level}")
        assert 3 < len(arrays) < 9
        assert all(b.at_ns - a.at_ns >= every for a, b in pairwise(arrays[:-1]))
        for each in arrays:
            expected = seen_in(log.replay(at=each.at_ns), level)
            assert expected == doors_in(shown_after([each.message]))
        assert seen_in(log.replay(), level) == doors_in(shown_after([arrays[-1].message]))


@pytest.mark.slow
def test_a_log_with_very_many_changes_gets_an_interval(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The shortest with which there are not too many doors in all messages together."""
    log = lively_log(tmp_path / "log", seed=5)

    plenty = record_bag(log, tmp_path / "x.mcap", MARKED).every_s
    monkeypatch.setattr(stream_module, "MOST_DOORS_SENT", 1000)
    few = record_bag(log, tmp_path / "y.mcap", MARKED).every_s

    assert (0, 600) == (plenty, few)


@pytest.mark.slow
def test_a_part_begins_with_what_was_there(tmp_path: Path) -> None:
    """Doors, database and floor plan stand at its first moment; nothing is later than its last."""
    log = lively_log(tmp_path / "log", seed=6)
    since, until = START + 9000 * SECOND, START + 15_000 * SECOND
    before = log.replay(at=since)

    record_bag(log, tmp_path / "x.mcap", MARKED, since=since, until=until)

    messages = played(tmp_path / "x.mcap")
    begin = [m for m in messages if m.at_ns == since]
    floors = {f"/map/level_{n}" for n, level in before.levels.items() if level.floor_map_event}
    assert floors | {f"{DOORS}/level_1", f"{DOORS}/level_2", THESIS} == {m.topic for m in begin}
    for level in (1, 2):
        (first,) = topic(begin, f"{DOORS}/level_{level}")
        assert seen_in(before, level) == doors_in(shown_after([first.message]))
        last = topic(messages, f"{DOORS}/level_{level}")[-1]
        assert seen_in(log.replay(at=until), level) == doors_in(shown_after([last.message]))
    assert until >= messages[-1].at_ns


@pytest.mark.slow
@pytest.mark.parametrize("name", BAGS)
def test_the_floor_plans_are_the_logs_own(name: str, tmp_path: Path) -> None:
    """The last plan of each level in its place, turned, and at its level's height."""
    log = lively_log(tmp_path / "log", seed=7)

    record_bag(log, tmp_path / name, MARKED)

    messages = played(tmp_path / name)
    checked = 0
    for moment in some_moments(log, seed=7):
        now = log.replay(at=moment)
        for level in (1, 2):
            floor = log.floor_of(now, level)
            (last,) = topic(messages, f"/map/level_{level}", moment)[-1:] or [None]
            assert (floor is None) == (last is None)
            if floor is None or last is None:
                continue
            info = last.message.info
            np.testing.assert_array_equal(
                floor.cells.reshape(info.height, info.width),
                np.array(last.message.data).reshape(info.height, info.width),
            )
            height = now.levels[level].elevation
            at, turn = info.origin.position, info.origin.orientation
            np.testing.assert_allclose(
                (floor.origin_x, floor.origin_y, height if math.isfinite(height) else 0.0,
                 floor.origin_theta),
                (at.x, at.y, at.z, 2 * math.atan2(turn.z, turn.w)), rtol=0, atol=1e-12,
            )  # fmt: skip
            checked += 1
    assert checked > 20


@pytest.mark.slow
@pytest.mark.parametrize("name", BAGS)
def test_the_robot_is_where_it_said_it_was(name: str, tmp_path: Path) -> None:
    """Each RobotPose is a PoseStamped, its stamp and its message's time are when it happened."""
    log = lively_log(tmp_path / "log", seed=1)
    expected = sorted((e.happened_ns, e.event) for e in log.history(kinds=[RobotPose]))

    record_bag(log, tmp_path / name, MARKED)

    poses = topic(played(tmp_path / name), "/semmap/robot_pose")
    assert 30 == len(poses)
    for (happened_ns, pose), each in zip(expected, poses, strict=True):
        assert isinstance(pose, RobotPose)
        message = each.message
        stamp, turn = message.header.stamp, message.pose.orientation
        assert happened_ns == each.at_ns == stamp.sec * SECOND + stamp.nanosec
        assert "map" == message.header.frame_id
        assert (pose.x, pose.y) == (message.pose.position.x, message.pose.position.y)
        assert math.isclose(pose.theta, 2 * math.atan2(turn.z, turn.w))


@pytest.mark.parametrize(("name", "info"), [("x.mcap", 20), ("x.bag", 2), ("x", 20)])
def test_the_events_say_who_did_what_and_why(name: str, info: int, tmp_path: Path) -> None:
    """A line an event but for poses: the door's name, the words, the kind and the number."""
    log = small_log(tmp_path / "log")

    record_bag(log, tmp_path / name, MARKED)

    lines = [m.message for m in topic(played(tmp_path / name), "/semmap/events")]
    said = [(line.name, line.msg, line.function) for line in lines]
    assert ("door 2", "removed from the map [anna: a wall now]", "DoorRemoved") in said
    assert ("front", "seen OPEN (90%) [rover]", "DoorObserved") in said
    assert ("semmap", "patrol 1 started", "PatrolStarted") in said
    assert {info} == {line.level for line in lines}
    entries_ = [e for e in log.history() if e.kind != "RobotPose"]
    assert sorted(e.number for e in entries_) == sorted(line.line for line in lines)


@pytest.mark.slow
def test_what_was_retracted_is_not_told(tmp_path: Path) -> None:
    """The retractions are."""
    log = lively_log(tmp_path / "log", seed=2)
    expected = {e.number for e in log.history() if not e.retracted and e.kind != "RobotPose"}

    record_bag(log, tmp_path / "x.mcap", MARKED)

    lines = [m.message for m in topic(played(tmp_path / "x.mcap"), "/semmap/events")]
    assert expected == {line.line for line in lines}
    assert 20 == sum(line.function == "Retracted" for line in lines)


def test_one_level_has_plain_names_and_lies_on_the_ground(tmp_path: Path) -> None:
    """`/map` and `/semmap/doors`, as RViz's and everybody's layouts have it."""
    log = small_log(tmp_path / "log")

    done = record_bag(log, tmp_path / "x.mcap", StreamOptions(markers=True, palette=COLOUR_BLIND))

    messages = played(tmp_path / "x.mcap")
    assert {"/map": 1, DOORS: 5, THESIS: 6, "/semmap/robot_pose": 10, "/semmap/events": 11} == (
        done.messages
    )
    last = doors_in(shown_after([topic(messages, DOORS)[-1].message]))
    assert {1: seen(log.replay().doors[sl.DoorId(1)], 0.0, COLOUR_BLIND)} == last


def test_doors_without_a_place_are_named(tmp_path: Path) -> None:
    """They are on no topic; an empty log makes a bag without messages."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=sl.DoorId(9))])
    sl.create(tmp_path / "empty", tz="UTC", clock=SteadyClock(START)).close()

    done = record_bag(sl.read(tmp_path / "log"), tmp_path / "x.mcap", MARKED)
    nothing = record_bag(sl.read(tmp_path / "empty"), tmp_path / "y.mcap", MARKED)

    assert ("door 9",) == done.left_out
    assert {0} == set(nothing.messages.values())
    messages = played(tmp_path / "x.mcap")
    assert [[]] == [entries(m.message) for m in topic(messages, THESIS)]
    assert [{}] == [doors_in(shown_after([m.message])) for m in topic(messages, DOORS)]


@pytest.mark.slow
@pytest.mark.parametrize("name", BAGS)
def test_the_same_log_gives_the_same_bytes(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Read in slices of any size, too."""
    log = lively_log(tmp_path / "log", seed=8)

    for folder, events in (("one", stream_module.SLICE_EVENTS), ("two", 7)):
        (tmp_path / folder).mkdir()
        monkeypatch.setattr(stream_module, "SLICE_EVENTS", events)
        record_bag(log, tmp_path / folder / name, MARKED)

    assert digests(tmp_path / "one") == digests(tmp_path / "two")


def digests(folder: Path) -> dict[str, str]:
    """Return the digest of each file below a folder."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.name: sha256(path.read_bytes()).hexdigest() for path in files}


def test_a_wrong_question_leaves_no_file(tmp_path: Path) -> None:
    """A name that tells no bag, the log's own folder, times backwards or beyond ROS's stamps."""
    log = small_log(tmp_path / "log")
    with sl.create(tmp_path / "late", tz="UTC", clock=SteadyClock(2**31 * SECOND)) as late:
        late.add_door(x=1.0, y=1.0, theta=0.0, width=1.0)
    before = set(tmp_path.rglob("*"))

    with pytest.raises(FormatError, match="unknown extension for a new bag"):
        record_bag(log, tmp_path / "x.zip", MARKED)
    with pytest.raises(OutputError, match="own folder"):
        record_bag(log, tmp_path / "log" / "x.mcap", MARKED)
    with pytest.raises(MomentError, match="swap them"):
        record_bag(log, tmp_path / "x.mcap", MARKED, since=START + SECOND, until=START)
    with pytest.raises(OutputError, match="from 1970 to January 2038"):
        record_bag(sl.read(tmp_path / "late"), tmp_path / "x.mcap", MARKED)

    assert before == set(tmp_path.rglob("*"))


def test_progress_goes_up_to_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is told how many of the events are done."""
    log = lively_log(tmp_path / "log", seed=2)
    monkeypatch.setattr(stream_module, "SLICE_EVENTS", 50)
    told: list[tuple[int, int]] = []

    record_bag(log, tmp_path / "x.mcap", MARKED, progress=lambda *shares: told.append(shares))

    assert sorted(told) == told
    assert len(told) > 3
    assert told[-1][0] == told[-1][1] == sum(not e.retracted for e in log.history())


def test_what_waits_is_sent_once_its_time_has_come(tmp_path: Path) -> None:
    """With nothing else to send then: not only when something happens again, an hour later."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, state="closed")
        clock.now_ns = START + SECOND
        log.observe(door, "open")
        clock.now_ns = START + 3600 * SECOND
        log.observe(door, "closed")

    record_bag(
        sl.read(tmp_path / "log"), tmp_path / "x.mcap", StreamOptions(markers=True, every_s=60)
    )

    first, waited, last = topic(played(tmp_path / "x.mcap"), DOORS)
    assert 60 * SECOND == waited.at_ns - first.at_ns
    assert START + 3600 * SECOND <= last.at_ns
