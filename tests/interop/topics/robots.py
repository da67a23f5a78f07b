"""A robot's messages, made by rosbags, and what a translator makes of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from semmap_log.core.model.events import Event
from semmap_log.interop.formats.ros.ros_types import (
    DOOR_ENTRY,
    DOOR_MAP,
    GRID,
    POSE_STAMPED,
    POSE_WITH_COVARIANCE,
    RMF_DOOR_REQUEST,
    RMF_DOOR_STATE,
    TRANSFORMS,
    MessageType,
    RosVersion,
    ros_types,
)
from semmap_log.interop.topics.topic_reader import Known, TopicProblems
from semmap_log.interop.topics.topic_rules import Reading, RosMapping, TopicRule
from semmap_log.interop.topics.translator import Made, Translator

START = 1_770_000_000_000_000_000
"""When the robot's day begins."""
S = 10**9


@dataclass
class Robot:
    """Makes the messages of a ROS."""

    version: RosVersion = 2

    def new(self, ros_type: str, /, **values: Any) -> Any:
        return ros_types(self.version).types[ros_type](**values)

    def encoded(self, ros_type: str, message: Any) -> bytes:
        types = ros_types(self.version)
        encode = types.serialize_ros1 if self.version == 1 else types.serialize_cdr
        return bytes(encode(message, ros_type))

    def time(self, at_ns: int) -> Any:
        return self.new("builtin_interfaces/msg/Time", sec=at_ns // S, nanosec=at_ns % S)

    def header(self, at_ns: int, frame: str) -> Any:
        count = {"seq": 0} if self.version == 1 else {}
        return self.new("std_msgs/msg/Header", stamp=self.time(at_ns), frame_id=frame, **count)

    def said(self, package_type: str, value: Any) -> tuple[str, bytes]:
        """A std_msgs message with its `data`."""
        name = f"std_msgs/msg/{package_type}"
        return name, self.encoded(name, self.new(name, data=value))

    def door_map(self, doors: Sequence[Mapping[str, Any]]) -> tuple[str, bytes]:
        entries = [self.new(DOOR_ENTRY, **(ENTRY | dict(door))) for door in doors]
        return DOOR_MAP, self.encoded(DOOR_MAP, self.new(DOOR_MAP, door_db=entries))

    def door_state(self, name: str, mode: int, at_ns: int = 0) -> tuple[str, bytes]:
        message = self.new(
            RMF_DOOR_STATE,
            door_time=self.time(at_ns),
            door_name=name,
            current_mode=self.new("rmf_door_msgs/msg/DoorMode", value=mode),
        )
        return RMF_DOOR_STATE, self.encoded(RMF_DOOR_STATE, message)

    def door_request(self, name: str, mode: int, who: str) -> tuple[str, bytes]:
        message = self.new(
            RMF_DOOR_REQUEST,
            request_time=self.time(0),
            requester_id=who,
            door_name=name,
            requested_mode=self.new("rmf_door_msgs/msg/DoorMode", value=mode),
        )
        return RMF_DOOR_REQUEST, self.encoded(RMF_DOOR_REQUEST, message)

    def pose(
        self, x: float, y: float, theta: float, *, at_ns: int = 0, frame: str = "map",
        variances: tuple[float, float] | None = None,
    ) -> tuple[str, bytes]:  # fmt: skip
        """A pose; with covariance if (that of x and y, that of theta) is given."""
        header, pose = self.header(at_ns, frame), self._pose(x, y, theta)
        if variances is None:
            return POSE_STAMPED, self.encoded(
                POSE_STAMPED, self.new(POSE_STAMPED, header=header, pose=pose)
            )
        import numpy as np

        covariance = np.zeros(36)
        covariance[[0, 7, 35]] = variances[0], variances[0], variances[1]
        inner = self.new("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance)
        message = self.new(POSE_WITH_COVARIANCE, header=header, pose=inner)
        return POSE_WITH_COVARIANCE, self.encoded(POSE_WITH_COVARIANCE, message)

    def transforms(
        self, *links: tuple[str, str, float, float, float], at_ns: int = 0
    ) -> tuple[str, bytes]:
        """Links (parent, child, x, y, theta)."""
        made = [
            self.new(
                "geometry_msgs/msg/TransformStamped",
                header=self.header(at_ns, parent),
                child_frame_id=child,
                transform=self.new(
                    "geometry_msgs/msg/Transform",
                    translation=self.new("geometry_msgs/msg/Vector3", x=x, y=y, z=0.0),
                    rotation=self._turn(theta),
                ),
            )
            for parent, child, x, y, theta in links
        ]
        return TRANSFORMS, self.encoded(TRANSFORMS, self.new(TRANSFORMS, transforms=made))

    def grid(
        self, cells: Any, *, resolution: float = 0.05, frame: str = "map", width: int | None = None
    ) -> tuple[str, bytes]:
        height, real_width = cells.shape
        info = self.new(
            "nav_msgs/msg/MapMetaData",
            map_load_time=self.time(0),
            resolution=resolution,
            width=real_width if width is None else width,
            height=height,
            origin=self._pose(-1.0, 2.0, 0.1),
        )
        message = self.new(GRID, header=self.header(0, frame), info=info, data=cells.reshape(-1))
        return GRID, self.encoded(GRID, message)

    def action_status(self, *goals: tuple[int, int]) -> tuple[str, bytes]:
        """Goals (number, status)."""
        if self.version == 1:
            name = "actionlib_msgs/msg/GoalStatusArray"
            listed = [
                self.new(
                    "actionlib_msgs/msg/GoalStatus",
                    goal_id=self.new("actionlib_msgs/msg/GoalID", stamp=self.time(0), id=str(goal)),
                    status=status,
                    text="",
                )
                for goal, status in goals
            ]
            message = self.new(name, header=self.header(0, ""), status_list=listed)
            return name, self.encoded(name, message)
        import numpy as np

        name = "action_msgs/msg/GoalStatusArray"
        listed = [
            self.new(
                "action_msgs/msg/GoalStatus",
                goal_info=self.new(
                    "action_msgs/msg/GoalInfo",
                    goal_id=self.new(
                        "unique_identifier_msgs/msg/UUID", uuid=np.full(16, goal, np.uint8)
                    ),
                    stamp=self.time(0),
                ),
                status=status,
            )
            for goal, status in goals
        ]
        return name, self.encoded(name, self.new(name, status_list=listed))

    def _pose(self, x: float, y: float, theta: float) -> Any:
        return self.new(
            "geometry_msgs/msg/Pose",
            position=self.new("geometry_msgs/msg/Point", x=x, y=y, z=0.0),
            orientation=self._turn(theta),
        )

    def _turn(self, theta: float) -> Any:
        return self.new(
            "geometry_msgs/msg/Quaternion",
            x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2),
        )  # fmt: skip


ENTRY = {
    "pos_x": 1.0, "pos_y": 2.0, "pos_theta": 0.5, "width": 0.9,
    "door_state": "OPEN", "prob_open": math.nan, "prob_closed": math.nan,
}  # fmt: skip
"""A door of a DoorMap, but for its id."""


@dataclass
class Listener:
    """A translator of some topics, and what it said."""

    readings: Mapping[str, Reading]
    known: Known = field(default_factory=Known)
    mapping: RosMapping = field(default_factory=RosMapping)
    version: RosVersion = 2
    told: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.complaints = TopicProblems(self.told.append)
        self.translator = Translator(self.mapping, self.known, self.complaints)
        for topic, reading in self.readings.items():
            self.translator.read_topic(topic, TopicRule(reading))

    def hear(self, topic: str, message: tuple[str, bytes], at_s: float = 0.0) -> list[Event]:
        return self.made(topic, message, at_s).events

    def made(self, topic: str, message: tuple[str, bytes], at_s: float = 0.0) -> Made:
        name, data = message
        kind = MessageType(name, self.version)
        return self.translator.take(topic, kind, data, START + round(at_s * S))
