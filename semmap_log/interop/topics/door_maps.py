"""Where the robot is, by poses in the map's frame or by TF: kept when it moved, at sightings.

It also reads doors of other sources. Of the DoorMap of another server, what differs from its last
message becomes events. What a message repeats about a door from the one before is no news, whatever
another sensor has seen meanwhile. Of the first message, and of news, what counts is the difference
to the log.

The server's ids are kept where they are free. A number that it uses again after a removal (the
thesis gives "the first free index") is another door: it gets a new id here, and an annotation on
it has the server's number. The annotation is on every door that came with the topic, so that
after a restart it is known which are the server's, and are gone once its map lacks them.

In RViz, somebody may click doors: two points are a door's line.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, cos, hypot, isfinite, sin
from struct import Struct
from typing import Any

from semmap_log.core.model import doors as door_model
from semmap_log.core.model import events as ev
from semmap_log.core.model.meaning import NOTHING, PLACING, Changed
from semmap_log.core.model.rigid_transform import yaw_of
from semmap_log.core.texts import command_line
from semmap_log.errors import InvalidEventError
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.topics.lasers.lasers import Lasers
from semmap_log.interop.topics.topic_reader import Context, TopicMessage, deviations
from semmap_log.interop.topics.topic_rules import ReadClicks, ReadDoorMap, ReadPose, ReadTransforms
from semmap_log.interop.topics.transforms import TransformTree


@dataclass(slots=True)
class PoseFilter:
    """The filter of poses; one robot's."""

    moved_m: float
    turned_rad: float
    _kept: ev.RobotPose | None = None
    _latest: ev.RobotPose | None = None

    def take(self, pose: ev.RobotPose) -> Iterator[ev.Event]:
        """Yield the pose if the robot has moved since the last one that was kept."""
        self._latest = pose
        if self._kept is None or self._has_moved(self._kept, pose):
            self._kept = pose
            yield pose

    def at_sighting(self) -> Iterator[ev.Event]:
        """Yield where the robot was last, unless that was kept already."""
        if self._latest is not None and not _is_same_place(self._latest, self._kept):
            self._kept = self._latest
            yield self._latest

    def _has_moved(self, kept: ev.RobotPose, pose: ev.RobotPose) -> bool:
        turned = abs(math.remainder(pose.theta - kept.theta, math.tau))
        return (
            pose.level != kept.level
            or math.hypot(pose.x - kept.x, pose.y - kept.y) >= self.moved_m
            or turned >= self.turned_rad
        )


def _is_same_place(pose: ev.RobotPose, other: ev.RobotPose | None) -> bool:
    places = [(each.level, each.x, each.y, each.theta) for each in (pose, other) if each]
    return len(places) == 2 and places[0] == places[1]


class Poses:
    """Reads PoseStamped and PoseWithCovarianceStamped."""

    def __init__(
        self, topic: str, rule: ReadPose, context: Context, track: PoseFilter, lasers: Lasers
    ) -> None:
        self._topic = topic
        self._robot = rule.robot
        self._lasers = lasers
        self._level = context.level(rule.level)
        self._context = context
        self._track = track

    def events(self, got: TopicMessage) -> Iterator[ev.Event]:
        """Return the pose, if the robot has moved."""
        header = got.message.header
        if not is_on_map(got, self._context):
            return
        self._lasers.take_pose(got, self._robot)
        covered = hasattr(got.message.pose, "covariance")
        pose = got.message.pose.pose if covered else got.message.pose
        sd_xy, sd_theta = deviations(got.message.pose.covariance) if covered else (math.nan,) * 2
        yield from self._track.take(
            ev.RobotPose(
                level=self._level,
                x=pose.position.x,
                y=pose.position.y,
                theta=yaw_of(pose.orientation),
                sd_xy=sd_xy,
                sd_theta=sd_theta,
                happened_ns=self._context.happened_ns(got, header.stamp),
            )
        )

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody."""
        return ""


def is_on_map(got: TopicMessage, context: Context) -> bool:
    """Return whether a pose is in the map's frame; complain if it is not."""
    frame, on_map = got.message.header.frame_id, context.mapping.map_frame
    if frame.removeprefix("/") == on_map:
        return True
    kind = f"a pose in another frame than {on_map}; passed over"
    context.complaints.add(got.topic, kind, shown(frame))
    return False


class Transforms:
    """Reads tf2_msgs/TFMessage: the robot is where the chain from map to it says."""

    def __init__(
        self, rule: ReadTransforms, context: Context, track: PoseFilter, tree: TransformTree
    ) -> None:
        self._level = context.level(rule.level)
        self._context = context
        self._track = track
        self._tree = tree
        self._topic = ""
        self._is_on_map = False

    def events(self, got: TopicMessage) -> Iterator[ev.Event]:
        """Return the pose, if the robot has moved."""
        mapping = self._context.mapping
        self._topic = got.topic
        changed = take_transforms(got, self._tree, self._context)
        chain = self._tree.chain(mapping.map_frame, mapping.robot_frame)
        self._is_on_map |= chain is not None
        if chain is None or changed.isdisjoint(chain):
            return
        if (late_s := self._tree.late_s(chain)) > MOST_LATE_S:
            self._context.complaints.add(
                got.topic, "transforms that are not of the same time; no pose", f"{late_s:.1f} s"
            )
            return
        x, y, theta = self._tree.pose(chain)
        yield from self._track.take(
            ev.RobotPose(
                level=self._level, x=x, y=y, theta=theta,
                happened_ns=self._context.happened_ns(got, self._tree.stamp(chain)),
            )
        )  # fmt: skip

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody."""
        return ""

    def why_no_pose(self) -> str:
        """Return why there was never a pose, in words; empty: there was, or no message came."""
        if self._is_on_map or not self._topic:
            return ""
        top, robot = self._context.mapping.map_frame, self._context.mapping.robot_frame
        links = self._tree.links()
        more = f" and {len(links) - MOST_LINKS} more" if len(links) > MOST_LINKS else ""
        there = ", ".join(f"{parent} to {child}" for parent, child in links[:MOST_LINKS])
        return (
            f"{self._topic}: no poses: no transform from {top} to {robot}; there is {there}{more}; "
            "a mapping file says what the frames are called: frames"
        )


def take_transforms(got: TopicMessage, tree: TransformTree, context: Context) -> set[str]:
    """Take a tf2_msgs/TFMessage into a tree; return the frames that it places."""
    is_static, strays = got.topic.endswith("tf_static"), tree.strays
    changed = {
        tree.take(each, got.received_ns, is_static=is_static) for each in got.message.transforms
    }
    if tree.strays > strays:
        kind = "a transform at odds with others of its link"
        context.complaints.add(got.topic, kind, tree.stray)
    return changed


MOST_LINKS = 5
"""So many are named where none of them helps."""
MOST_LATE_S = 10.0
"""A link of the chain that came so long before the others is one that nobody sends any more."""


@dataclass(frozen=True, slots=True)
class _Entry:
    """A door as the message has it."""

    x: float
    y: float
    theta: float
    width: float
    state: door_model.DoorState
    prob_open: float
    prob_closed: float

    @property
    def is_placed(self) -> bool:
        return not math.isnan(self.x)


class DoorMaps:
    """Reads lta_semantic_map/DoorMap."""

    def __init__(self, topic: str, rule: ReadDoorMap, context: Context) -> None:
        self._topic = topic
        self._rule = rule
        self._context = context
        self._level = context.level(rule.level)
        self._key = f"id in {topic}"
        """Of the annotation that holds the server's number of a door."""
        self._door_of: dict[int, door_model.DoorId] | None = None
        """The server's number -> our door, of all that its map had, or that came with it once."""
        self._last: dict[int, bytes] = {}
        """The server's number -> its last report of that door."""

    def events(self, got: TopicMessage) -> Iterator[ev.Event]:
        """Return what makes the doors we know those of the message."""
        happened_ns = self._context.happened_ns(got)
        numbers = [int(entry.door_id) for entry in got.message.door_db]
        twice = [number for number, count in Counter(numbers).items() if count > 1]
        if twice:
            self._complain("a map that has a door twice; passed over", f"door {twice[0]}")
            return
        if self._door_of is None:
            self._door_of = self._remembered()
        for number, entry in zip(numbers, got.message.door_db, strict=True):
            said = _packed(entry)
            if said == self._last.get(number) and self._is_there(number):
                continue
            door = self._door(number, entry)
            try:
                found = self._entry(entry)
                if door is None:
                    yield from self._added(number, found, happened_ns, set(numbers))
                else:
                    self._door_of[number] = door
                    yield from self._updated(self._context.known.doors[door], found, happened_ns)
                self._last[number] = said
            except InvalidEventError as error:
                self._complain("a door with an impossible value; left as it was",
                               f"door {number}: {error}")  # fmt: skip
        yield from self._removed(set(numbers), happened_ns)

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody: the message has no actor."""
        return ""

    def forget(self) -> None:
        """Look again at what the log remembers."""
        self._door_of = None
        self._last.clear()

    def _remembered(self) -> dict[int, door_model.DoorId]:
        """Return the doors that came from the server, as far as the log shows."""
        doors = [door for door in self._context.known.doors.values() if door.object_class.is_door]
        own = {
            int(text): door.door_id
            for door in doors
            if (text := door.annotations.get(self._key, "")).isdecimal()
        }
        if self._rule.removes != "all":
            return own
        taken = set(own.values())
        others = {
            int(door.door_id): door.door_id
            for door in doors
            if door.is_placed and door.level == self._level and door.door_id not in taken
        }
        return others | own

    def _door(self, number: int, entry: Any) -> door_model.DoorId | None:
        """Return our door that the server calls by that number; None: a new one."""
        assert self._door_of is not None
        if self._is_there(number):
            return self._door_of[number]
        door = self._context.known.doors.get(number)
        if door is None or self._key in door.annotations or not door.object_class.is_door:
            return None  # not there, known to be another of the server's, or a dock and the like
        if not door.is_placed and not math.isnan(entry.pos_x):
            return None  # a sensor without geometry, which a server of doors knows nothing of
        return door.door_id

    def _is_there(self, number: int) -> bool:
        """Return whether a door of the server is known, and in our map."""
        assert self._door_of is not None
        return self._door_of.get(number) in self._context.known.doors

    def _entry(self, entry: Any) -> _Entry:
        text = str(entry.door_state)
        state = door_model.thesis_state(text)
        if state is None:
            self._complain("a state other than OPEN, CLOSED, UNKNOWN; taken as UNKNOWN",
                           shown(text))  # fmt: skip
            state = door_model.DoorState.UNKNOWN
        for what in door_model.suspect_units(theta=entry.pos_theta, width=entry.width):
            self._complain("a door whose values may be of another unit; taken as they are",
                           f"door {entry.door_id}: {what}")  # fmt: skip
        return _Entry(
            float(entry.pos_x),
            float(entry.pos_y),
            float(entry.pos_theta),
            float(entry.width),
            state,
            float(entry.prob_open),
            float(entry.prob_closed),
        )

    def _added(
        self, number: int, entry: _Entry, happened_ns: int | None, others: set[int]
    ) -> Iterator[ev.Event]:
        is_free = number not in self._context.known.used_ids
        door = door_model.DoorId(number) if is_free else self._context.known.next_id_but(others)
        yield ev.DoorAdded(
            door_id=door, level=self._level, x=entry.x, y=entry.y, theta=entry.theta,
            width=entry.width, state=entry.state, prob_open=entry.prob_open,
            prob_closed=entry.prob_closed, happened_ns=happened_ns,
        )  # fmt: skip
        assert self._door_of is not None
        self._door_of[number] = door
        yield ev.DoorAnnotated(
            door_id=door, key=self._key, value=str(number), happened_ns=happened_ns
        )

    def _updated(
        self, door: door_model.Door, entry: _Entry, happened_ns: int | None
    ) -> Iterator[ev.Event]:
        changed = NOTHING
        if entry.is_placed:
            if (door.x, door.y, door.theta) != (entry.x, entry.y, entry.theta):
                changed |= Changed.POSE
            if door.width != entry.width:
                changed |= Changed.WIDTH
        elif door.is_placed:
            self._complain("a door that has lost its place; it stays where it was",
                           f"door {door.door_id}")  # fmt: skip
        if door_model.reduced(door.state) != entry.state:
            changed |= Changed.STATE
        if _is_other(door.prob_open, entry.prob_open):
            changed |= Changed.PROB_OPEN
        if _is_other(door.prob_closed, entry.prob_closed):
            changed |= Changed.PROB_CLOSED
        if not door.is_placed and changed & PLACING:
            changed |= PLACING
        if changed:
            moves, widens = Changed.POSE in changed, Changed.WIDTH in changed
            yield ev.DoorUpdated(
                door_id=door.door_id,
                changed=changed,
                level=door.level,
                x=entry.x if moves else math.nan,
                y=entry.y if moves else math.nan,
                theta=entry.theta if moves else math.nan,
                width=entry.width if widens else math.nan,
                state=entry.state if Changed.STATE in changed else door_model.DoorState.UNKNOWN,
                prob_open=entry.prob_open,
                prob_closed=entry.prob_closed,
                happened_ns=happened_ns,
            )

    def _removed(self, numbers: set[int], happened_ns: int | None) -> Iterator[ev.Event]:
        assert self._door_of is not None
        known = self._context.known
        for number, door in sorted(self._door_of.items()):
            if number in numbers:
                continue
            if door in known.doors and self._rule.removes != "none":
                if happened_ns is not None and happened_ns < known.added_ns(door):
                    self._complain("a door that is gone before it came, by the clock; it stays",
                                   f"door {door}")  # fmt: skip
                    continue
                yield ev.DoorRemoved(door_id=door, happened_ns=happened_ns)
            if door not in known.doors:
                del self._door_of[number]

    def _complain(self, kind: str, example: str) -> None:
        self._context.complaints.add(self._topic, kind, example)


_NUMBERS = Struct("<6d")


def _packed(entry: Any) -> bytes:
    """Return what an entry says, as bytes: NaN is the same as NaN."""
    numbers = (entry.pos_x, entry.pos_y, entry.pos_theta, entry.width, entry.prob_open,
               entry.prob_closed)  # fmt: skip
    return _NUMBERS.pack(*numbers) + str(entry.door_state).encode()


def _is_other(known: float, told: float) -> bool:
    """Return whether a probability is given, and differs."""
    return not math.isnan(told) and told != known


LEAST_M, MOST_M = 0.4, 6.0
"""A door's width."""
TWICE_M = 0.3
"""A door whose both ends are so near to those of another is that door, clicked twice."""


@dataclass(frozen=True, slots=True)
class _Click:
    x: float
    y: float
    received_ns: int


class ClickedDoors:
    """Reads PointStamped: the first click is the hinge, the start of the line; the second its end.

    What cannot be a door's width is complained about, and both clicks are forgotten; a second click
    that comes too late is the first one of another door.
    """

    def __init__(self, topic: str, rule: ReadClicks, context: Context) -> None:
        self._topic = topic
        self._rule = rule
        self._context = context
        self._level = context.level(rule.level)
        self._first: _Click | None = None
        self.said = ""
        """What the last message did, for who clicks."""

    def events(self, got: TopicMessage) -> Iterator[ev.Event]:
        """Return a door, where the message is its second click."""
        self.said = ""
        click = self._click(got)
        if click is None:
            return
        first, self._first = self._first, click
        if first is None or self._is_late(first, click):
            self.said = f"a door's hinge at {click.x:.2f}, {click.y:.2f}; now click its other end"
            return
        self._first = None
        width = hypot(click.x - first.x, click.y - first.y)
        theta = atan2(click.y - first.y, click.x - first.x)
        if not LEAST_M <= width <= MOST_M:
            self._complain(
                f"two clicks that are no door: expected {LEAST_M} to {MOST_M:g} m between them; "
                "click both ends again",
                f"{width:.2f} m",
            )
            return
        there = self._there(first, click)
        if there is not None:
            self._complain("a door that the log has; passed over", f"door {there.door_id}")
            return
        new = self._context.known.next_id
        happened_ns = self._context.happened_ns(got, got.message.header.stamp)
        name = f"clicked {(first.x + click.x) / 2:.1f} {(first.y + click.y) / 2:.1f}"
        self.said = (
            f"door {new} from {first.x:.2f}, {first.y:.2f} to {click.x:.2f}, {click.y:.2f}, "
            f"{width:.2f} m wide; wrong? {command_line('remove', 'LOG', str(new))}"
        )
        yield ev.DoorAdded(
            door_id=new, level=self._level, x=first.x, y=first.y, theta=theta, width=width,
            happened_ns=happened_ns,
        )  # fmt: skip
        yield ev.DoorAnnotated(door_id=new, key="name", value=name, happened_ns=happened_ns)

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody: a click has no actor."""
        return ""

    def _click(self, got: TopicMessage) -> _Click | None:
        """Return where it was clicked; None: nowhere on this level."""
        frame = got.message.header.frame_id.removeprefix("/")
        if frame != self._context.mapping.map_frame:
            self._complain(
                f"a click in another frame than {self._context.mapping.map_frame}; passed over: "
                "set RViz's Fixed Frame",
                shown(frame),
            )
            return None
        point = got.message.point
        if not all(map(isfinite, (point.x, point.y, point.z))):
            self._complain("a click that is nowhere; passed over", f"{point.x} {point.y} {point.z}")
            return None
        low, high = self._rule.heights
        if not low <= point.z <= high:
            self._complain(
                f"a click on another level; passed over: expected z from {low:g} to {high:g} m",
                f"{point.z:.2f} m",
            )
            return None
        return _Click(float(point.x), float(point.y), got.received_ns)

    def _is_late(self, first: _Click, second: _Click) -> bool:
        """Return whether the second click is not of the same door; complain if so."""
        waited_s = (second.received_ns - first.received_ns) / 1e9
        if 0 <= waited_s <= self._rule.within_s:
            return False
        self._complain(
            f"a second click more than {self._rule.within_s:g} s after the first; taken as the "
            "first of another door",
            f"{waited_s:.0f} s",
        )
        return True

    def _there(self, first: _Click, second: _Click) -> door_model.Door | None:
        """Return the door of this level that has these ends, whichever way round."""
        ends = (first.x, first.y), (second.x, second.y)
        for door in self._context.known.doors.values():
            if door.is_placed and door.level == self._level:
                start = door.x, door.y
                end = door.x + door.width * cos(door.theta), door.y + door.width * sin(door.theta)
                if any(_are_near(ends, way) for way in ((start, end), (end, start))):
                    return door
        return None

    def _complain(self, kind: str, example: str) -> None:
        self._context.complaints.add(self._topic, kind, example)


_Ends = tuple[tuple[float, float], tuple[float, float]]


def _are_near(some: _Ends, others: _Ends) -> bool:
    return all(
        hypot(x - other_x, y - other_y) < TWICE_M
        for (x, y), (other_x, other_y) in zip(some, others, strict=True)
    )
