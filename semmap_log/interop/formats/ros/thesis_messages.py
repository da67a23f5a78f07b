"""The thesis's DoorMap message (4.2.5, appendix C): what its costmap layer and OPRS listen to."""

from __future__ import annotations

import math
from collections.abc import Iterable

from semmap_log.core.model.doors import Door, reduced
from semmap_log.interop.formats.ros.array_messages import ArrayType, EncodedElement
from semmap_log.interop.formats.ros.ros_messages import Messages
from semmap_log.interop.formats.ros.ros_types import DOOR_ENTRY, DOOR_MAP, RosVersion


class ThesisMessages:
    """Builds DoorMaps: door after door of all levels, which the message knows nothing of."""

    def __init__(self, ros_version: RosVersion, default_prob: float | None) -> None:
        """Choose.

        Args:
            ros_version: Whose bytes.
            default_prob: Stands for a probability that was not given; None: NaN does.
        """
        self._messages = Messages(ros_version)
        self._type = ArrayType(ros_version, DOOR_MAP, "door_db", DOOR_ENTRY)
        self._default_prob = math.nan if default_prob is None else default_prob

    def encoded(self, door: Door) -> EncodedElement:
        """Return a door's entry; its state is OPEN, CLOSED or UNKNOWN."""
        return self._type.encoded(
            self._messages.new(
                DOOR_ENTRY,
                door_id=int(door.door_id),
                pos_x=door.x,
                pos_y=door.y,
                pos_theta=door.theta,
                width=door.width,
                door_state=reduced(door.state).name,
                prob_open=self._given(door.prob_open),
                prob_closed=self._given(door.prob_closed),
            )
        )

    def message(self, doors: Iterable[EncodedElement]) -> bytes:
        """Return the message with these entries."""
        return self._type.joined(doors)

    def _given(self, prob: float) -> float:
        return self._default_prob if math.isnan(prob) else prob
