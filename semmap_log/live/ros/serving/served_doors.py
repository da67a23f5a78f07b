"""The doors as a server offers them: the thesis's DoorMap, and markers for RViz, at each change."""

from __future__ import annotations

from semmap_log.core.model.doors import DoorMap
from semmap_log.interop.exporting.latest_doors import LatestDoors
from semmap_log.interop.exporting.stream_topics import LevelDoors, ThesisDoors, heights_of
from semmap_log.interop.formats.bags.bag_protocol import BagTopic, NewBag
from semmap_log.interop.formats.ros.door_markers import DoorMarkers
from semmap_log.interop.formats.ros.ros_types import DOOR_MAP, MARKERS
from semmap_log.interop.formats.ros.thesis_messages import ThesisMessages
from semmap_log.live.ros.serving.served_topics import ChangedDoors, LevelNames, levels_of
from semmap_log.views.palette import DEFAULT, Palette

DOOR_DB = BagTopic("lta_semantic_map_door_db", DOOR_MAP, is_latched=True)
"""The thesis's topic (4.2.5); relative, so that it follows the node's namespace."""
MARKERS_NAME = "semmap/doors"


class ServedDoors:
    """Sends messages that are the whole truth, each when it is another than the last one."""

    def __init__(
        self,
        topics: NewBag,
        names: LevelNames,
        *,
        palette: Palette = DEFAULT,
        default_prob: float | None = None,
    ) -> None:
        """Choose how doors look.

        Args:
            topics: Where the messages go.
            names: Of the topics of levels.
            palette: Colours of the markers.
            default_prob: Stands in the DoorMap for probabilities that were not given; None: NaN.
        """
        self._topics = topics
        self._names = names
        self._palette = palette
        self._markers = DoorMarkers(topics.ros_version)
        self._thesis = ThesisDoors(ThesisMessages(topics.ros_version, default_prob))
        self._levels: dict[int, LevelDoors] = {}
        self._heights: dict[int, float] = {}
        self._changes = ChangedDoors()
        self._has_sent = False

    def show(self, doors: DoorMap, at_ns: int) -> None:
        """Send what is another than before; the first time, all.

        Raises:
            RosError: A message's type is not installed.
        """
        others, is_raised = self._take_levels(doors)
        is_thesis_new = not self._has_sent
        changed = self._changes.take(doors)
        if is_raised:
            changed |= doors.doors
        for door_id, door in changed.items():
            is_thesis_new |= self._thesis.show(door_id, door)
            for level, shown in self._levels.items():
                if shown.show(door_id, door, self._heights.get(level, 0.0)):
                    others.add(level)
        if is_thesis_new:
            self._topics.write_encoded(DOOR_DB, at_ns, self._thesis.message())
        for level in sorted(others):
            topic = self._names.topic(MARKERS_NAME, level, MARKERS)
            self._topics.write_encoded(topic, at_ns, self._levels[level].message())
        self._has_sent = True

    def _take_levels(self, doors: DoorMap) -> tuple[set[int], bool]:
        """Take in new levels and their heights; return the new ones, and if any is drawn anew."""
        levels = levels_of(doors) | self._levels.keys() or {0}
        elevations = {n: level.elevation for n, level in doors.levels.items()}
        heights = heights_of(LatestDoors(elevations=elevations), dict.fromkeys(levels))
        if heights == self._heights:
            return set(), False
        new = levels - self._levels.keys()
        self._levels |= {n: LevelDoors(self._markers, n, self._palette) for n in new}
        self._heights = heights
        return new, True
