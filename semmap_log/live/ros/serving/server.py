"""The server on a ROS node: the doors on topics at each change, and the thesis's four actions.

It also offers the doors as grids that stock planners take: no plugin of ours is needed in the
robot. On `semmap/costmap` floor and doors together: in place of `/map` for costmap_2d's
StaticLayer. On `semmap/door_layer` the doors alone: 100 where one is closed, 0 where one is open,
-1 elsewhere. Nav2's KeepoutFilter takes that as its mask: it writes what is dearer than the
costmap, skips -1, and frees by 0 only what the costmap does not know. A second StaticLayer with
`use_maximum` does the same. Values between, 1 to 99, come with belief and inflation
(`CostmapOptions`); a StaticLayer takes them as costs where its `trinary_costmap` is false, else as
free.

A door outside the grid, where no floor plan sets its size, makes a larger grid: StaticLayer takes
over the new size.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from semmap_log.analysis.costmap_2d.costs import DoorLayer
from semmap_log.analysis.costmap_2d.layered import LayeredCostmap
from semmap_log.analysis.costmaps import level_costmap
from semmap_log.analysis.costmaps.door_layer_fold import line_of
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CostmapError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.door_messages import GridFrame, GridStream
from semmap_log.interop.formats.ros.ros_types import GRID, GRID_UPDATE
from semmap_log.live.ros.ros_node import Goal, Outcome, RosNode, action_name
from semmap_log.live.ros.serving import served_topics
from semmap_log.live.ros.serving.door_server import ACTIONS
from semmap_log.log import DoorLog
from semmap_log.views.palette import DEFAULT, Palette


class Doors(Protocol):
    """What is served: a `DoorServer`, or a `DoorFollower`."""

    def door_map(self) -> DoorMap:
        """Return the doors as they are now."""

    def floor_of(self, doors: DoorMap, level: int) -> FloorMap | None:
        """Return a level's floor plan, as of a door map."""

    @property
    def log(self) -> DoorLog:
        """The log with all that is written now."""

    def run(self, goal: Goal) -> Outcome:
        """Do what a goal asks for."""


@dataclass(frozen=True, slots=True)
class ServeOptions:
    """What is offered besides the thesis's topic and actions."""

    costmap: bool = False
    floors: dict[int, FloorMap] = field(default_factory=dict)
    """Floor plans that count instead of the log's, by level."""
    palette: Palette = DEFAULT
    default_prob: float | None = None
    """Stands in the DoorMap for probabilities that were not given; None: NaN does."""
    costs: level_costmap.CostmapOptions = field(default_factory=level_costmap.CostmapOptions)
    """What doors cost in the grids."""
    patrol: served_topics.PatrolWish | None = None
    """What the robot is to visit; None: no plan is offered."""


class Server:
    """Offers the doors; `wake` is to be set after each change."""

    def __init__(
        self, node: RosNode, doors: Doors, wake: threading.Event, options: ServeOptions
    ) -> None:
        """Take up the doors; nothing is offered yet.

        Args:
            node: The node.
            doors: What is served.
            wake: Set when there is something new.
            options: What is offered.
        """
        self._node = node
        self._doors = doors
        self._wake = wake
        self._ending = False
        self._failure: Exception | None = None
        known = doors.door_map()
        names = served_topics.LevelNames(served_topics.levels_of(known) | options.floors.keys())
        topics = served_topics.ServedTopics(node)
        self._shown: list[served_topics.ServedDoors | ServedCostmaps | served_topics.ServedPlan] = [
            served_topics.ServedDoors(
                topics, names, palette=options.palette, default_prob=options.default_prob
            )
        ]
        if options.costmap:
            self._shown.append(
                ServedCostmaps(
                    topics,
                    names,
                    doors.floor_of,
                    lambda text: node.log(text, is_warning=True),
                    floors=options.floors,
                    options=options.costs,
                )
            )

        if options.patrol is not None:  # last: to plan takes its time
            self._shown.append(
                served_topics.ServedPlan(
                    topics,
                    lambda: doors.log,
                    lambda text: node.log(text, is_warning=True),
                    options.patrol,
                )
            )

    def run(self, stop: Callable[[], bool], ready: Callable[[], None] = lambda: None) -> None:
        """Serve until stopped, or until ROS ends.

        Args:
            stop: Called again and again.
            ready: Called once the map and all actions are offered.

        Raises:
            RosError: A type is not installed.
            LogError: A log that is followed is damaged, or was exchanged.
        """
        self._wake.clear()
        self._show()  # who finds the actions finds the map, too
        thread = threading.Thread(target=self._show_changes, name="show", daemon=True)
        thread.start()
        for action in ACTIONS:
            self._node.serve_action(action, action_name(self._node, action), self._doors.run)
        try:
            ready()
            self._node.run(lambda: stop() or self._failure is not None)
        finally:
            self._ending = True
            self._wake.set()
            thread.join()
        if self._failure is not None:
            raise self._failure

    def _show_changes(self) -> None:
        """Show the doors after each change, or changes that came together: the last one, always.

        One thread shows them all, so that no older map ever follows a newer one.
        """
        try:
            while not self._ending:
                self._wake.wait()
                self._wake.clear()  # before looking: what comes now is looked at again
                self._show()
        except Exception as error:  # noqa: BLE001  a server that shows nothing must not go on
            self._failure = error

    def _show(self) -> None:
        doors, at_ns = self._doors.door_map(), self._node.now_ns()
        for shown in self._shown:
            shown.show(doors, at_ns)


MASTER_NAME = "semmap/costmap"
LAYER_NAME = "semmap/door_layer"
UPDATES = "_updates"
"""RViz looks for a map's changes under its topic's name and this.

StaticLayers do so, too, where `subscribe_to_updates` is set. Better leave it: move_base's remembers
only where the last update lay, so of two between its cycles it hands on the second (incomingUpdate
in costmap_2d/plugins/static_layer.cpp). The whole grid follows each update anyway.
"""

MOST_CELLS = 10_000_000
"""Of a grid around doors: whoever may add a door far away must not fill the memory by that."""

FloorOf = Callable[[DoorMap, int], FloorMap | None]
Changes = Mapping[DoorId, Door | None]
"""Doors as they are now; None: gone."""


class ServedCostmaps:
    """The grids of all levels, sent when they have changed."""

    def __init__(
        self,
        topics: served_topics.ServedTopics,
        names: served_topics.LevelNames,
        floor_of: FloorOf,
        warn: Callable[[str], None],
        *,
        floors: dict[int, FloorMap] | None = None,
        options: level_costmap.CostmapOptions = level_costmap.CostmapOptions(),
    ) -> None:
        """Choose.

        Args:
            topics: Where the messages go.
            names: Of the topics of levels.
            floor_of: Gives a level's floor plan, as of a door map.
            warn: Called with the reason, once each, why a level has no grid.
            floors: Floor plans that count instead.
            options: What doors cost; all levels are shown.
        """
        self._topics = topics
        self._options = options
        self._names = names
        self._floor_of = floor_of
        self._warn = warn
        self._floors = floors or {}
        self._levels: dict[int, _Level] = {}
        self._changes = served_topics.ChangedDoors()
        self._lacking: set[int] = set()
        """Levels whose grid is not as it should be."""
        self._warned: dict[int, str] = {}
        self._at_ns = 0

    def show(self, doors: DoorMap, at_ns: int) -> None:
        """Send what is another than before; a level's first time, all of it.

        Raises:
            RosError: A message's type is not installed.
        """
        self._at_ns = max(self._at_ns, at_ns)  # a simulation may begin again
        changed = self._changes.take(doors)
        for level in sorted(
            served_topics.levels_of(doors) | self._floors.keys() | self._levels.keys()
        ):
            self._show_level(doors, level, changed)

    def _show_level(self, doors: DoorMap, level: int, changed: Changes) -> None:
        """Show a level; where it can have no new grid, what the old one has room for."""
        known = self._levels.get(level)
        plan = self._plan_event(doors, level)
        to_fit = dict(doors.doors) if level in self._lacking else changed
        if known is None or known.plan_event != plan or not known.has_room_for(to_fit):
            try:
                known = self._new(doors, level, plan)
                self._levels[level], changed = known, dict(doors.doors)
                self._lacking.discard(level)
            except CostmapError as error:
                self._lacking.add(level)
                self._tell(level, str(error))
        if known is not None:
            known.show(changed, self._at_ns)

    def _tell(self, level: int, problem: str) -> None:
        if self._warned.get(level) != problem:
            self._warned[level] = problem
            self._warn(f"no new costmap of level {level}: {problem}")

    def _plan_event(self, doors: DoorMap, level: int) -> int | None:
        """Return a number that identifies a level's floor plan."""
        known = doors.levels.get(level)
        return None if known is None or level in self._floors else known.floor_map_event

    def _new(self, doors: DoorMap, level: int, plan: int | None) -> _Level:
        floor = self._floors.get(level) or self._floor_of(doors, level)
        return _Level(
            self._topics, self._names, doors, level,
            floor=floor, plan_event=plan, options=self._options,
        )  # fmt: skip


class _Level:
    """A level's two grids."""

    def __init__(
        self,
        topics: served_topics.ServedTopics,
        names: served_topics.LevelNames,
        doors: DoorMap,
        level: int,
        *,
        floor: FloorMap | None,
        plan_event: int | None,
        options: level_costmap.CostmapOptions,
    ) -> None:
        self.plan_event = plan_event
        self._level = level
        self._floor = floor
        self._by, self._only = options.by, options.object_class
        self._geometry = geometry = level_costmap.geometry_of(
            floor, level_costmap.ends_of(doors, level), level, options
        )
        if floor is None and geometry.width * geometry.height > MOST_CELLS:
            raise CostmapError(
                f"a grid around the doors: expected at most {MOST_CELLS:,} cells, got "
                f"{geometry.width:,} x {geometry.height:,}; give a map with --map, or remove the "
                "door that is far away"
            )
        self._layer = DoorLayer(geometry)
        layers = level_costmap.layers_of(geometry, floor, self._layer, options)
        self._master = LayeredCostmap(geometry, layers, track_unknown=floor is None)

        def stream(name: str) -> GridStream:
            grids = names.topic(name, level, GRID)
            updates = BagTopic(grids.name + UPDATES, GRID_UPDATE, is_latched=False)
            topics.offer(updates)
            return GridStream(topics, geometry, every_ns=0, updates=True, topics=(grids, updates))

        self._of_layer, self._of_master = stream(LAYER_NAME), stream(MASTER_NAME)

    def has_room_for(self, doors: Changes) -> bool:
        """Return whether these doors lie on the grid; a floor plan's size is fixed."""
        if self._floor is not None:
            return True
        there = (door for door in doors.values() if door and self._is_here(door))
        ends = (end for door in there for end in door.extent)
        return all(self._geometry.world_to_map(x, y) is not None for x, y in ends)

    def show(self, doors: Changes, at_ns: int) -> None:
        """Draw doors as they are now, and send what changed by that."""
        lines = {
            door_id: line_of(door, level=self._level, by=self._by, only=self._only)
            for door_id, door in doors.items()
        }
        drawn = self._layer.update(lines)
        changed = self._master.update()
        self._of_layer.take(GridFrame(at_ns, self._layer.costs, drawn))
        self._of_master.take(GridFrame(at_ns, self._master.costs, changed))

    def _is_here(self, door: Door) -> bool:
        return door.is_placed and door.level == self._level
