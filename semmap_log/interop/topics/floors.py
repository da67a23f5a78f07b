"""Floor plans, from nav_msgs/OccupancyGrid: each content once."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from semmap_log.core.model.doors import MAX_LEVEL
from semmap_log.core.model.events import Event, FloorMap
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.topics.topic_reader import Context, TopicMessage, yaw_of
from semmap_log.interop.topics.topic_rules import ReadFloorMap
from semmap_log.log.door_log.command_content import are_same

_NEW_LEVEL = re.compile(f"[0-9]{{1,{len(str(MAX_LEVEL))}}}")

MOST_CELLS = 100_000_000


class FloorMaps:
    """Reads a map's topic."""

    def __init__(self, topic: str, rule: ReadFloorMap, context: Context) -> None:
        self._topic = topic
        self._context = context
        self._level = _level(rule.level, context)

    def events(self, got: TopicMessage) -> Iterator[Event]:
        """Return the floor plan, unless it is the one that is known."""
        frame = got.message.header.frame_id.removeprefix("/")
        if frame != self._context.mapping.map_frame:
            self._context.complaints.add(
                self._topic,
                f"a map in another frame than {self._context.mapping.map_frame}; passed over",
                shown(frame),
            )
            return
        drawn = replace(self._drawn(got), happened_ns=None)
        known = self._context.known.floor_maps.get(self._level)
        if known is None or not are_same([drawn], [known]):
            yield replace(drawn, happened_ns=self._context.happened_ns(got))

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody."""
        return ""

    def _drawn(self, got: TopicMessage) -> FloorMap:
        info = got.message.info
        cells = np.asarray(got.message.data, np.int8)
        if cells.size != info.width * info.height or not 0 < cells.size <= MOST_CELLS:
            raise ValueError(f"{cells.size:,} cells for a map of {info.width} x {info.height}")
        return FloorMap(
            level=self._level,
            resolution=float(info.resolution),
            origin_x=info.origin.position.x,
            origin_y=info.origin.position.y,
            origin_theta=yaw_of(info.origin.orientation),
            cells=cells.reshape(info.height, info.width),
        )


def _level(text: str | None, context: Context) -> int:
    """Return the level that is drawn; a number may be that of a new one.

    Raises:
        UnknownLevelError: There is none of that name, or there are several.
    """
    if text is not None and _NEW_LEVEL.fullmatch(text) and int(text) <= MAX_LEVEL:
        return int(text)
    return context.level(text)
