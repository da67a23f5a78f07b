"""Where the robot is, by poses in the map's frame or by TF: kept when it moved, at sightings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from semmap_log.core.model.events import Event, RobotPose
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.topics.lasers.lasers import Lasers
from semmap_log.interop.topics.topic_reader import Context, TopicMessage, deviations, yaw_of
from semmap_log.interop.topics.topic_rules import ReadPose, ReadTransforms
from semmap_log.interop.topics.transforms import TransformTree


@dataclass(slots=True)
class PoseFilter:
    """The filter of poses; one robot's."""

    moved_m: float
    turned_rad: float
    _kept: RobotPose | None = None
    _latest: RobotPose | None = None

    def take(self, pose: RobotPose) -> Iterator[Event]:
        """Yield the pose if the robot has moved since the last one that was kept."""
        self._latest = pose
        if self._kept is None or self._has_moved(self._kept, pose):
            self._kept = pose
            yield pose

    def at_sighting(self) -> Iterator[Event]:
        """Yield where the robot was last, unless that was kept already."""
        if self._latest is not None and not _is_same_place(self._latest, self._kept):
            self._kept = self._latest
            yield self._latest

    def _has_moved(self, kept: RobotPose, pose: RobotPose) -> bool:
        turned = abs(math.remainder(pose.theta - kept.theta, math.tau))
        return (
            pose.level != kept.level
            or math.hypot(pose.x - kept.x, pose.y - kept.y) >= self.moved_m
            or turned >= self.turned_rad
        )


def _is_same_place(pose: RobotPose, other: RobotPose | None) -> bool:
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

    def events(self, got: TopicMessage) -> Iterator[Event]:
        """Return the pose, if the robot has moved."""
        header = got.message.header
        if not is_on_map(got, self._context):
            return
        self._lasers.take_pose(got, self._robot)
        covered = hasattr(got.message.pose, "covariance")
        pose = got.message.pose.pose if covered else got.message.pose
        sd_xy, sd_theta = deviations(got.message.pose.covariance) if covered else (math.nan,) * 2
        yield from self._track.take(
            RobotPose(
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
    """Tell whether a pose is in the map's frame; complain if it is not."""
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

    def events(self, got: TopicMessage) -> Iterator[Event]:
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
            RobotPose(
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
