"""The patrol's stops as a server publishes them: what is left, when it changes, and whose round."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from shutil import copytree

import pytest

import semmap_log as sl
from semmap_log.core.model.events import (
    DoorAdded,
    DoorPassed,
    Event,
    PatrolFinished,
    PatrolStarted,
    RobotPose,
)
from semmap_log.core.model.moments import SECOND_NS, parse_instant
from semmap_log.interop.formats.ros.ros_types import RosVersion
from semmap_log.live.ros.serving.served_topics import PLAN, PatrolWish, ServedPlan, ServedTopics
from tests.analysis.planning.ward import DOOR_Y, FRONT, LAB, TZ, ward
from tests.conftest import SteadyClock
from tests.live.ros.collecting_node import CollectingNode

START_NS = parse_instant("2026-03-23T10:00", tz=TZ)
LAB_POSE = (8.45, 1.95)
FRONT_POSE = (0.95, 1.95)
HALL_POSE = RobotPose(level=1, x=5.0, y=1.0, theta=0.0)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ward(tmp_path_factory.mktemp("plan") / "log").path


class Served:
    """A log that is written, and a server's plan of it."""

    def __init__(self, path: Path, wish: PatrolWish, version: RosVersion = 2) -> None:
        self.clock = SteadyClock(START_NS)
        self.writer = sl.append(path, clock=self.clock)
        self.node = CollectingNode(version)
        self.warnings: list[str] = []
        self.wish = wish
        self.start()

    def start(self) -> None:
        """Start the server, or start it again."""
        topics = ServedTopics(CollectingNode(self.node.ros_version))
        topics._node = self.node
        self.node.topics.clear()
        self.plan = ServedPlan(topics, lambda: self.writer, self.warnings.append, self.wish)

    def tell(self, *events: Event, at_s: float) -> list[tuple[float, float]]:
        """Record events, and return the places of the last message, rounded."""
        at_ns = START_NS + round(at_s * SECOND_NS)
        self.clock.now_ns = max(self.clock.now_ns, at_ns)
        self.writer.append([replace(event, happened_ns=at_ns) for event in events])
        return self.shown()

    def shown(self) -> list[tuple[float, float]]:
        self.plan.show(self.writer.door_map(), self.clock.now_ns)
        return [(round(p.position.x, 2), round(p.position.y, 2)) for p in self.messages[-1].poses]

    @property
    def messages(self) -> list:
        return self.node.messages[PLAN.name]


@pytest.fixture(params=[1, 2])
def served(kept: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Served]:
    copytree(kept, tmp_path / "log")
    served = Served(tmp_path / "log", PatrolWish(rooms=("lab", "2")), request.param)
    yield served
    served.writer.close()


def test_what_is_left_where_to_stand_and_which_way(served: Served) -> None:
    """In the map's frame, latched, the next stop first; sent again only when it has changed."""
    first = served.tell(HALL_POSE, PatrolStarted(patrol=1), at_s=0)
    passed = served.tell(DoorPassed(door_id=LAB, passed=True), at_s=10)
    served.tell(replace(HALL_POSE, x=6.0), at_s=12)

    assert (first, passed) == ([LAB_POSE, FRONT_POSE], [FRONT_POSE])
    assert len(served.messages) == 2
    assert PLAN.is_latched
    message = served.messages[0]
    assert message.header.frame_id == "map"
    lab = message.poses[0]
    yaw = 2 * math.atan2(lab.orientation.z, lab.orientation.w)
    ahead = (lab.position.x + math.cos(yaw), lab.position.y + math.sin(yaw))
    assert ahead[1] > DOOR_Y > lab.position.y


def test_a_log_without_rounds_has_one_from_the_start_on(served: Served) -> None:
    """From its end, and from where the robot was then."""
    assert sorted(served.shown()) == sorted([LAB_POSE, FRONT_POSE])


def test_a_round_that_is_over_and_the_next(served: Served) -> None:
    """An empty array; another start in the log plans anew, with all stops."""
    served.tell(HALL_POSE, PatrolStarted(patrol=1), at_s=0)

    over = served.tell(PatrolFinished(patrol=1), at_s=30)
    still = served.tell(DoorPassed(door_id=FRONT, passed=True), at_s=40)
    served.start()
    after_restart = served.shown()
    another = served.tell(HALL_POSE, PatrolStarted(patrol=2), at_s=600)

    assert (over, still, after_restart) == ([], [], [])
    assert another == [LAB_POSE, FRONT_POSE]


def test_all_visited_is_over_too(served: Served) -> None:
    """Nobody needs to say so."""
    served.tell(HALL_POSE, PatrolStarted(patrol=1), at_s=0)
    served.tell(DoorPassed(door_id=LAB, passed=True), at_s=10)

    assert served.tell(DoorPassed(door_id=FRONT, passed=True), at_s=40) == []


def test_a_server_that_is_started_again_goes_on(served: Served) -> None:
    """The round under way is the log's, and what was visited in it stays visited."""
    served.tell(HALL_POSE, PatrolStarted(patrol=1), at_s=0)
    left = served.tell(DoorPassed(door_id=LAB, passed=True), at_s=10)

    served.start()

    assert served.shown() == left == [FRONT_POSE]


def test_a_start_that_is_taken_back(served: Served) -> None:
    """The round before goes on."""
    served.tell(HALL_POSE, PatrolStarted(patrol=1), at_s=0)
    before = served.tell(DoorPassed(door_id=LAB, passed=True), at_s=10)
    again = served.tell(PatrolStarted(patrol=2), at_s=20)
    last = served.writer.last_event()

    served.writer.retract(last)

    assert len(again) == 2
    assert served.shown() == before


def test_a_log_without_doors_is_tried_again(tmp_path: Path) -> None:
    """The server says why there is no plan, offers an empty one."""
    sl.create(tmp_path / "log", tz=TZ).close()
    served = Served(tmp_path / "log", PatrolWish())

    empty = served.shown()
    there = served.tell(DoorAdded(door_id=1, x=1.0, y=2.0, theta=0.0, width=1.0), at_s=5)

    assert (empty, there) == ([], [(1.5, 2.0)])
    assert ["no door is in the map" in warning for warning in served.warnings] == [True]
    served.writer.close()


def test_a_finished_round_is_not_planned(served: Served) -> None:
    """Nobody is warned that it cannot be."""
    served.tell(HALL_POSE, PatrolStarted(patrol=1), at_s=0)
    served.tell(PatrolFinished(patrol=1), at_s=30)
    served.wish = PatrolWish(rooms=("99",))

    served.start()

    assert (served.shown(), served.warnings) == ([], [])


def test_a_room_that_is_not_there(served: Served) -> None:
    """Is said; the server goes on with the doors."""
    served.wish = PatrolWish(rooms=("99",))
    served.start()

    assert served.shown() == []
    assert "99" in served.warnings[0]
