"""One run of the experiment: a world, a robot in it, and goals; what happens is recorded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from navigation.door_daemon import DoorDaemon
from navigation.door_sensor import DoorSensor
from navigation.floors import Floor
from navigation.goal_orders import order_of
from navigation.goal_sender import GoalSender
from navigation.goals import Goals
from navigation.laser import Laser
from navigation.move_base import MoveBase
from navigation.obstacle_layer import ObstacleLayer
from navigation.options import RunOptions
from navigation.records import Json, RunKey, RunRecorder
from navigation.robot import Robot, Senses
from navigation.setups import SETUPS, Setup
from navigation.streams import Streams
from navigation.ways import planner
from navigation.world import World
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded


@dataclass(frozen=True)
class RunTask:
    """A run to be made."""

    building: Path
    """The Open-RMF plan."""
    level: int
    setup: str
    series: str
    seed: int
    options: RunOptions

    @property
    def key(self) -> RunKey:
        """Which run it is; what is not as usual stands behind the building's name."""
        name = f"{self.building.name.removesuffix('.building.yaml')}_L{self.level}"
        changed = (f"{option}={value}" for option, value in self.options.changed().items())
        return RunKey(",".join([name, *changed]), self.setup, self.series, self.seed)


def run(
    task: RunTask, floor: Floor, out: Path, progress: Callable[[int], None] = lambda _: None
) -> Path:
    """Make a run; return its folder. The same task gives the same bytes.

    Args:
        task: What to run.
        floor: The building's level.
        out: Below it the run gets its folder, when it is over.
        progress: Told how many goals were reached, after each.

    Raises:
        MissingPlannerError: pyastar2d is not installed.
        RunError: The run is there already.
    """
    planner()
    setup, options = SETUPS[task.setup], task.options
    place = f"{floor.name} {task.level}"
    streams = Streams(place, task.setup, task.series, task.seed)
    daemon = DoorDaemon(
        floor.door_ids, streams.of("doors"), base=options.base, reading=options.reading
    )
    laser = Laser(
        floor.walls, cell_m=floor.geometry.resolution, range_m=options.sense_m,
        noise_m=options.noise_m, rng=streams.noise("laser"), clears_beyond=options.clears_beyond,
    )  # fmt: skip
    recorder = RunRecorder(
        out, task.key, floor.events, _parameters(task), states=daemon.states(),
        believed=daemon.states() if setup.map else _unknown(floor),
    )  # fmt: skip
    with recorder:
        world = World(floor, daemon, laser, every_s=options.every_s)
        world.tell(lambda at_s, door, _: recorder.door_changed(at_s, door, daemon.states()[door]))
        goals = Goals(floor, streams.of("goals"))
        robot = Robot(
            floor, world, setup, _senses(setup, options, laser, floor, streams),
            recorder=recorder, start=goals.start(streams.of("start")),
        )  # fmt: skip
        move_base = MoveBase(
            robot, recovery_clears=options.recovery_clears, margin_m=options.margin_m
        )
        order = order_of(setup.order, robot, move_base, options.window)
        sender = GoalSender(
            robot, move_base, order, recorder, rejected_within_s=options.rejected_within_s,
            most_tries=options.most_tries,
        )  # fmt: skip
        sender.send(goals, options.goals, progress)
    return recorder.folder


def _parameters(task: RunTask) -> dict[str, Json]:
    return {"level": task.level, "plan": task.building.name, **asdict(task.options)}


def _unknown(floor: Floor) -> dict[DoorId, DoorState]:
    """Return the doors of a robot that has no map of them."""
    added = (event for event in floor.events if isinstance(event, DoorAdded))
    return {event.door_id: DoorState.UNKNOWN for event in added}


def _senses(
    setup: Setup, options: RunOptions, laser: Laser, floor: Floor, streams: Streams
) -> Senses:
    has_sensor = setup.map and not setup.smart
    sensor = DoorSensor(streams.of("sensor"), options.notices) if has_sensor else None
    obstacles = ObstacleLayer(floor.walls, laser.margin) if setup.obstacles else None
    return Senses(laser, sensor, options.near_m, obstacles)
