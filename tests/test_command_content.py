"""A command that is sent again is stored once, and one that only borrows its id is refused."""

from __future__ import annotations

import json
import random
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.folds.rebasing import are_same
from semmap_log.core.messages import decode, encode
from semmap_log.core.model.commits import GIVEN_EVENTS, NO_CONTENT
from semmap_log.core.model.events import (
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    Event,
    FloorMap,
    RobotPose,
)
from semmap_log.errors import CommandReusedError, LogError, UnexpectedEventError
from tests.conftest import SteadyClock
from tests.sent_commands import send
from tests.strategies import events

ID = bytes(range(16))


@pytest.fixture
def log(tmp_path: Path):
    with sl.create(tmp_path / "log", tz="UTC") as opened:
        opened.add_door(name="front")
        yield opened


def test_the_same_events_are_stored_once(log: sl.DoorLogWriter) -> None:
    """And answered with the first commit; the clock's time in the stored ones does not count."""
    seen = [DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)]
    first = log.append(seen, command_id=ID)
    again = log.append(list(seen), command_id=ID)

    assert not first.repeated
    assert again.repeated
    assert first.commit == again.commit
    assert first.first_event == again.first_event


@pytest.mark.parametrize(
    ("other", "note"),
    [
        ([DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.CLOSED)], sl.Note()),
        ([DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN, happened_ns=5)], sl.Note()),
        ([DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)] * 2, sl.Note()),
        ([DoorAnnotated(door_id=sl.DoorId(1), key="a", value="b")], sl.Note()),
        ([DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)], sl.Note(actor="else")),
    ],
)
def test_other_content_under_the_same_id_is_refused(log, other, note) -> None:
    """The error names the event that is stored; nothing is written."""
    log.append([DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)], command_id=ID)
    before = log.end_ns()

    with pytest.raises(CommandReusedError, match="as event 2,"):
        log.append(other, note=note, command_id=ID)
    assert before == log.end_ns()


@pytest.mark.usefixtures("patient_poses")
def test_poses_that_waited_are_no_part_of_the_command(log: sl.DoorLogWriter) -> None:
    """The same answer, though the first time a pose stood before its events."""
    log.robot_pose(RobotPose(x=1.0, y=2.0, theta=0.0))
    seen = [DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)]
    first = log.append(seen, command_id=ID)
    again = log.append(seen, command_id=ID)

    assert 1 == first.poses
    assert (first.first_event, first.count) == (again.first_event, again.count)
    assert 1 == len(first.events) == len(again.events)


@pytest.mark.usefixtures("patient_poses")
def test_poses_that_waited_are_written_once(log: sl.DoorLogWriter) -> None:
    """With the next commit, and not with the one behind it."""
    log.robot_pose(RobotPose(x=1.0, y=2.0, theta=0.0))

    assert [1, 0] == [log.observe(1, "open").poses, log.observe(1, "closed").poses]
    assert 1 == sum(len(batch) for batch in log.batches(kinds=[RobotPose]))


def test_a_verb_is_known_by_its_words(log: sl.DoorLogWriter) -> None:
    """Whatever they mean by now: the name is another door's, the next free id another."""
    first = log.add_door(name="back", command_id=ID)
    log.remove_door("front", command_id=bytes(16))
    log.annotate(first, "name", "front")

    assert first == log.add_door(name="back", command_id=ID)
    assert log.remove_door("front", command_id=bytes(16)).repeated
    with pytest.raises(CommandReusedError):
        log.add_door(name="side", command_id=ID)
    with pytest.raises(CommandReusedError):
        log.remove_door("back", command_id=bytes(16))
    with pytest.raises(CommandReusedError):
        log.observe("front", "open", command_id=ID)
    with pytest.raises(CommandReusedError):
        log.add_door(name="back", command_id=ID, reason="another")
    assert ["front"] == [door.name for door in log.replay().doors.values()]


def test_a_repeated_command_survives_reopening(tmp_path: Path) -> None:
    """It is found in the log, not in the writer's memory."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        door = log.add_door(command_id=ID)
    for _ in range(3):
        with sl.append(path) as log:
            assert door == log.add_door(command_id=ID)

    assert 1 == len(sl.read(path).replay())


def _as_stored(event: Event, recorded_ns: int) -> Event:
    """Return an event as the log gives it back."""
    happened_ns = recorded_ns if event.happened_ns is None else event.happened_ns
    level = event.level if isinstance(event, FloorMap) else 0
    return decode(event.kind, encode(event, happened_ns), happened_ns, level)


@settings(max_examples=60, deadline=None)
@given(st.lists(events, min_size=1, max_size=4), st.integers(0, 3))
def test_events_are_known_again_whatever_they_are(given_events, i: int) -> None:
    """As they come back from the log; and one that is left out, or another, is noticed."""
    stored = [_as_stored(event, 10**18) for event in given_events]

    assert are_same(given_events, stored)
    assert not are_same(given_events[:-1], stored)
    other = DoorAdded(door_id=sl.DoorId(4_000_000_000), happened_ns=1)
    assert not are_same([*given_events[:i], other, *given_events[i + 1 :]], stored)


def test_a_floor_plan_is_known_again(log: sl.DoorLogWriter) -> None:
    """Though its angle went through a quaternion, and its resolution through a float32."""
    cells = np.zeros((3, 4), np.int8)
    plan = FloorMap(
        level=0, resolution=0.05, origin_x=1.0, origin_y=2.0, origin_theta=0.3, cells=cells
    )
    log.append([plan], command_id=ID)

    assert log.append([plan], command_id=ID).repeated
    cells = cells.copy()
    cells[0, 0] = 1
    other = FloorMap(
        level=0, resolution=0.05, origin_x=1.0, origin_y=2.0, origin_theta=0.3, cells=cells
    )
    with pytest.raises(CommandReusedError):
        log.append([other], command_id=ID)


def test_an_expected_event_of_the_log(log: sl.DoorLogWriter) -> None:
    """The caller is told the actual number, and nothing is written."""
    seen = [DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)]
    log.append(seen, expected_event=1)

    with pytest.raises(
        UnexpectedEventError, match=r"expected event 1 .* of the log, got 2"
    ) as told:
        log.append(seen, expected_event=1)
    assert (1, 2) == (told.value.expected, told.value.actual)
    assert 3 == log.append(seen, expected_event=2).first_event


def test_an_expected_event_of_an_empty_log(tmp_path: Path) -> None:
    """-1: there is none yet."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(expected_event=-1)

        with pytest.raises(UnexpectedEventError, match="got 0"):
            log.add_door(expected_event=-1)


def test_an_expected_event_of_a_door(log: sl.DoorLogWriter) -> None:
    """What happens to other doors does not matter."""
    other = log.add_door()
    last = log.replay()[sl.DoorId(1)].last_event
    log.observe(other, "open")
    log.observe(1, "open", expected_event=last)

    with pytest.raises(UnexpectedEventError, match=r"of door 1, got 4"):
        log.update_door("front", state="closed", expected_event=last)
    log.remove_door("front", expected_event=4)


def test_a_repeated_command_is_not_judged_again(log: sl.DoorLogWriter) -> None:
    """It was right when it came first; the log has gone on since, by itself."""
    log.observe(1, "open", expected_event=1, command_id=ID)

    assert log.observe(1, "open", expected_event=1, command_id=ID).repeated


GOLDEN = Path(__file__).parent / "golden" / "sent_commands"
FLAGS = {NO_CONTENT, GIVEN_EVENTS}
BY_AN_EARLIER_VERSION = json.loads((GOLDEN / "answers.json").read_text())


@pytest.mark.filterwarnings("ignore::semmap_log.errors.EarlyEventsWarning")
def test_what_an_earlier_version_stored_is_known_again(tmp_path: Path) -> None:
    """Each command, by the digest of its words or by its events."""
    shutil.copytree(GOLDEN, tmp_path / "office")
    before = list(sl.read(tmp_path / "office").commits())

    with sl.append(tmp_path / "office", compact=False) as log:
        answers = send(log)

    assert BY_AN_EARLIER_VERSION == json.loads(json.dumps(answers))
    assert before == list(sl.read(tmp_path / "office").commits())


@pytest.mark.filterwarnings("ignore::semmap_log.errors.EarlyEventsWarning")
def test_the_same_commands_become_the_same_commits(tmp_path: Path) -> None:
    """As an earlier version wrote them, but for the digest where a command has none, or no id."""
    entropy = random.Random(18).randbytes
    with sl.create(
        tmp_path / "office", tz="Europe/Vienna", building="office", robot="r1",
        clock=SteadyClock(), entropy=entropy, compact=False,
    ) as log:  # fmt: skip
        send(log)

    made = list(sl.read(tmp_path / "office").commits())
    expected = [
        replace(commit, content=one.content if one.content in FLAGS else commit.content,
                hash=one.hash, previous_hash=one.previous_hash)
        for commit, one in zip(sl.read(GOLDEN).commits(), made, strict=True)
    ]  # fmt: skip
    assert made == expected
    assert GIVEN_EVENTS in {one.content for one in made}


def test_a_command_is_asked_nothing_of_a_log_that_was_closed(tmp_path: Path) -> None:
    """What makes its events may write a file: not where no commit can tell of it."""
    asked: list[int] = []
    log = sl.create(tmp_path / "log", tz="UTC")
    log.close()

    with pytest.raises(LogError, match="was closed"):
        log.append_made(lambda: asked.append(1) or [])
    assert [] == asked


def test_a_command_may_turn_out_to_want_nothing(log: sl.DoorLogWriter) -> None:
    """Then nothing is stored, and its id is free."""
    before = log.last_event()

    assert log.append_made(list, command_id=ID) is None
    assert before == log.last_event()
    assert not log.observe(1, "open", command_id=ID).repeated
