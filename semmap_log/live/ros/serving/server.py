"""The server on a ROS node: the doors on topics at each change, and the thesis's four actions."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from semmap_log.analysis.costmaps.level_costmap import CostmapOptions
from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.keywords import knows_its_keywords
from semmap_log.live.ros.action_names import action_name
from semmap_log.live.ros.ros_node import Goal, Outcome, RosNode
from semmap_log.live.ros.serving.door_server import ACTIONS
from semmap_log.live.ros.serving.served_costmap import ServedCostmaps
from semmap_log.live.ros.serving.served_doors import ServedDoors
from semmap_log.live.ros.serving.served_plan import PatrolWish, ServedPlan
from semmap_log.live.ros.serving.served_topics import LevelNames, ServedTopics, levels_of
from semmap_log.log.door_log.door_log import DoorLog
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


@knows_its_keywords
@dataclass(frozen=True, slots=True)
class ServeOptions:
    """What is offered beside the thesis's topic and actions."""

    costmap: bool = False
    floors: dict[int, FloorMap] = field(default_factory=dict)
    """Floor plans that count instead of the log's, by level."""
    palette: Palette = DEFAULT
    default_prob: float | None = None
    """Stands in the DoorMap for probabilities that were not given; None: NaN does."""
    costs: CostmapOptions = field(default_factory=CostmapOptions)
    """What doors cost in the grids."""
    patrol: PatrolWish | None = None
    """What the robot is to visit; None: no plan is offered."""


class Server:
    """Offers the doors; its `wake` is to be told of each change."""

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
        names = LevelNames(levels_of(known) | options.floors.keys())
        topics = ServedTopics(node)
        self._shown: list[ServedDoors | ServedCostmaps | ServedPlan] = [
            ServedDoors(topics, names, palette=options.palette, default_prob=options.default_prob)
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
                ServedPlan(
                    topics,
                    lambda: doors.log,
                    lambda text: node.log(text, is_warning=True),
                    options.patrol,
                )
            )

    def run(self, stop: Callable[[], bool], ready: Callable[[], None] = lambda: None) -> None:
        """Serve until told to stop, or until ROS ends.

        Args:
            stop: Asked again and again.
            ready: Told once the map and all actions are offered.

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
