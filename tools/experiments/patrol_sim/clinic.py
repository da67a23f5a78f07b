"""The clinic: two levels, 132 doors, one robot, one week in March 2026."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence

from patrol_sim import clinic_people
from patrol_sim.clinic_people import FIRE_DOOR
from patrol_sim.expected import Moment
from patrol_sim.habits import habit_of, live
from patrol_sim.journal import Journal
from patrol_sim.robot import Robot, Stop
from patrol_sim.routes import FloorRoutes, Point
from patrol_sim.sensor import Sensor
from patrol_sim.world import World
from semmap_log.core.model.events import DoorRemoved, Event

TZ = "Europe/Vienna"
ROBOT = "tinyRobot1"
CELL_M = 0.2
DAYS = 7

LIFT: Point = (43.07, -7.43)
"""The plan's lift_1, the same on levels 1 and 2, metres, frame `map`."""
HOME: Point = (54.79, -10.80)
"""The charger tinyRobot_1_charger on level 2."""

PORTALS = {
    "L1_clinic_a", "L1_clinic_b", "L1_left_inner", "L1_right_inner", FIRE_DOOR,
    "L2_clinic_a", "L2_clinic_b", "m", "L2_right_inner",
}  # fmt: skip
"""Doors that the robot goes through; they open when it asks."""

DOOR_CAMERA = Sensor("door_camera", accuracy_open=0.97, accuracy_closed=0.95)

WORKDAY_ROUNDS = (0, 3, *range(6, 20), 21)
WEEKEND_ROUNDS = (0, 4, 7, 9, 11, 13, 15, 17, 19, 22)
"""Hours at which rounds start; the charger has the robot in between."""


def tell(plan: Sequence[Event], monday_ns: int, rng: random.Random) -> Journal:
    """Return the week's commits, settled.

    Args:
        plan: The events that the import of the building gives.
        monday_ns: Local midnight with which the week begins.
        rng: Where all chance comes from.
    """
    world = World.from_plan(plan, monday_ns)
    clinic_people.build(world)
    ends_ns = world.moment(DAYS, "00:00")
    for door_id, name in world.names.items():
        world.habits[door_id] = habit_of(name, rng)
        world.truths[door_id] = live(world.habits[door_id], monday_ns, ends_ns, rng)

    journal = Journal()
    journal.add(world.moment(0, "00:05"), *plan, actor="survey", source="clinic.building.yaml",
                reason="first import of the building")  # fmt: skip
    clinic_people.act(world, journal, rng)
    _rounds(world, journal, rng)
    # On Thursday the robot is out of reach of the network, and sends it all afterwards.
    journal.hold_back(world.moment(3, "14:00"), world.moment(3, "15:10"), ROBOT)
    journal.settle()
    clinic_people.take_back(world, journal)
    return journal


def _rounds(world: World, journal: Journal, rng: random.Random) -> None:
    """Let the robot go its rounds: hourly on working days, a few at night and at the weekend."""
    portals = {door_id for door_id, name in world.names.items() if name in PORTALS}
    routes = {
        level: FloorRoutes(
            floor, [d for d in world.doors.values() if d.level == level], portals, CELL_M
        )
        for level, floor in world.floors.items()
    }
    robot = Robot(
        ROBOT, world=world, routes=routes, home=HOME, home_level=2, lift={1: LIFT, 2: LIFT},
        sensor=DOOR_CAMERA, journal=journal, rng=rng,
    )  # fmt: skip
    upper, lower = _stops(world, routes[2], 2, HOME), _stops(world, routes[1], 1, LIFT)
    outside = world.named("L1_wc_1")
    for number, (day, hour) in enumerate(_schedule(), start=1):
        starts_ns = world.moment(day, f"{hour}:00") + round(rng.uniform(15, 240)) * 10**9
        robot.now_ns = max(starts_ns, robot.now_ns + 5 * 60 * 10**9)
        stops = [*upper, *lower] if number % 2 else [*reversed(upper), *reversed(lower)]
        if not (day < 5 and 6 <= hour <= 18):  # the main entrance would be locked behind it
            stops = [stop for stop in stops if stop.door_id != outside]
        robot.patrol(number, _round_name(day, hour), stops)


def _schedule() -> Iterator[tuple[int, int]]:
    for day in range(DAYS):
        for hour in WORKDAY_ROUNDS if day < 5 else WEEKEND_ROUNDS:
            if (day, hour) != (0, 0):  # the building is only just being imported
                yield day, hour


def _round_name(day: int, hour: int) -> str:
    night = not 6 <= hour < 21
    return "night round" if night else "weekend round" if day >= 5 else "day round"


def _stops(world: World, routes: FloorRoutes, level: int, start: Point) -> list[Stop]:
    """Return where to stop to see each door of a level, in a good order.

    The fire door is passed anyway; a door that the robot cannot get near is left out.
    """
    seen_from = {
        point: door.door_id
        for door in world.doors.values()
        if door.level == level and world.names[door.door_id] != FIRE_DOOR
        and (point := routes.viewpoint(door, start)) is not None
    }  # fmt: skip
    return [Stop(level, point, seen_from[point]) for point in routes.tour(start, seen_from)]


def moments(journal: Journal, monday_ns: int) -> list[Moment]:
    """Return the moments whose state ships with the recording."""
    at = World(monday_ns, {}, {}, {}).moment
    _, removal = journal.find(lambda event: isinstance(event, DoorRemoved))
    return [
        Moment("Tuesday before dawn: all is shut", at_ns=at(1, "03:30")),
        Moment("Wednesday morning, before the fire door", at_ns=at(2, "08:59")),
        Moment("Thursday 15:00, with all that is known today", at_ns=at(3, "15:00")),
        Moment("Thursday 15:00 as believed then: the robot was cut off since 14:00",
               known_at_ns=at(3, "15:00")),
        Moment("the last event before a door was removed", event=removal - 1),
        Moment("Friday 23:00 as believed on Saturday at 9:00, before the lens was found dirty",
               at_ns=at(4, "23:00"), known_at_ns=at(5, "09:00")),
        Moment("Friday 23:00, with all that is known today", at_ns=at(4, "23:00")),
        Moment("the end"),
    ]  # fmt: skip
