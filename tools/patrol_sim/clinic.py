"""The clinic: two levels, 132 doors, one robot, one week in March 2026."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence

from patrol_sim.expected import Moment
from patrol_sim.habits import habit_of, live
from patrol_sim.journal import Journal
from patrol_sim.robot import Robot, Sensor, Stop
from patrol_sim.routes import FloorRoutes, Point
from patrol_sim.world import World
from semmap_log.doors import DoorId, DoorState
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorRemoved,
    DoorUpdated,
    Event,
)

TZ = "Europe/Vienna"
ROBOT = "tinyRobot1"
CELL_M = 0.2
DAYS = 7

LEVEL_1, LEVEL_2 = 1, 2
LIFT: Point = (43.07, -7.43)
"""The plan's lift_1, the same on both levels, metres, frame `map`."""
HOME: Point = (54.79, -10.80)
"""The charger tinyRobot_1_charger on level 2."""

DOOR_CAMERA = Sensor("door_camera", accuracy_open=0.97, accuracy_closed=0.95)

MANAGER, NURSE = "facility manager", "ward nurse"

FIRE_DOOR, FIRE_DOOR_BUILT = "L1_fire_door_west", (2, "09:00")
WALLED_UP, WALLED_UP_AT = "L1_left_counsel_4", (4, "16:00")

PORTALS = {
    "L1_clinic_a", "L1_clinic_b", "L1_left_inner", "L1_right_inner", FIRE_DOOR,
    "L2_clinic_a", "L2_clinic_b", "m", "L2_right_inner",
}  # fmt: skip
"""Doors that the robot goes through; they open when it asks."""

WORKDAY_ROUNDS = (0, 3, *range(6, 20), 21)
WEEKEND_ROUNDS = (0, 4, 7, 9, 11, 13, 15, 17, 19, 22)


def tell(plan: Sequence[Event], monday_ns: int, rng: random.Random) -> Journal:
    """Return the week's commits, settled.

    Args:
        plan: The events that the import of the building gives.
        monday_ns: Local midnight with which the week begins.
        rng: Where all chance comes from.
    """
    world = World.from_plan(plan, monday_ns)
    fire_door = _fire_door(max(world.doors) + 1)
    world.doors[fire_door.door_id] = fire_door
    world.names[fire_door.door_id] = FIRE_DOOR
    world.built_ns[fire_door.door_id] = world.moment(*FIRE_DOOR_BUILT)
    world.gone_ns[world.named(WALLED_UP)] = world.moment(*WALLED_UP_AT)
    for door_id, name in world.names.items():
        world.habits[door_id] = habit_of(name, rng)
        world.truths[door_id] = live(
            world.habits[door_id], monday_ns, world.moment(DAYS, "00:00"), rng
        )

    journal = Journal()
    survey_ns = world.moment(0, "00:05")
    journal.add(survey_ns, *plan, actor="survey", source="clinic.building.yaml",
                reason="first import of the building")  # fmt: skip
    _people(world, journal, fire_door, rng)
    _rounds(world, journal, rng)
    journal.hold_back(world.moment(3, "14:00"), world.moment(3, "15:10"), ROBOT)
    journal.settle()
    _second_thoughts(world, journal)
    return journal


def _fire_door(number: int) -> DoorAdded:
    """Return the door that is built on Wednesday, across the western corridor of level 1."""
    return DoorAdded(
        door_id=DoorId(number), level=LEVEL_1, x=11.875, y=-30.9, theta=0.0, width=2.375,
        state=DoorState.OPEN, prob_open=0.7, prob_closed=0.3,
    )  # fmt: skip


def _people(world: World, journal: Journal, fire_door: DoorAdded, rng: random.Random) -> None:
    """Write down what people do and report; what they do to a door becomes true."""
    for day in range(6):
        opens, closes = ("06:30", "20:00") if day < 5 else ("08:00", "14:00")
        for name in ("L1_clinic_a", "L1_clinic_b"):
            _set(world, journal, name, DoorState.OPEN, (day, opens), minutes=10,
                 actor=MANAGER, reason="opened for the day")  # fmt: skip
            _set(world, journal, name, DoorState.CLOSED, (day, closes), minutes=300,
                 actor=MANAGER, reason="locked for the night")  # fmt: skip
    wards = [name for name in world.names.values() if name.startswith("L2_left_consult")]
    outer = [name for name in wards if name.endswith("_outer")]
    for day in range(DAYS):
        for name in rng.sample(outer, 3):
            _set(world, journal, name, DoorState.CLOSED, (day, "21:05"), minutes=480,
                 actor=NURSE, reason="patient asleep: keep shut")  # fmt: skip

    stores = [i for i, name in world.names.items() if name.endswith(("_ahu", "_supplies"))]
    for door_id in stores:
        journal.add(
            world.moment(1, "11:20"),
            DoorUpdated(door_id=door_id, changed=Changed.PROB_OPEN | Changed.PROB_CLOSED,
                        prob_open=0.02, prob_closed=0.98),
            actor=MANAGER, reason="store rooms are kept locked",
        )  # fmt: skip
    journal.add(
        world.moment(1, "11:30"),
        DoorAnnotated(door_id=world.named("m"), key="name", value="L2_left_inner"),
        actor=MANAGER, reason="the plan calls it m",
    )  # fmt: skip
    journal.add(
        world.moment(*FIRE_DOOR_BUILT),
        fire_door,
        DoorAnnotated(door_id=fire_door.door_id, key="name", value=FIRE_DOOR),
        DoorAnnotated(door_id=fire_door.door_id, key="kind", value="double_hinged"),
        actor=MANAGER, reason="new fire door in the western corridor",
    )  # fmt: skip
    hr = world.doors[world.named("L1_hr")]
    journal.add(
        world.moment(3, "07:45"),
        DoorUpdated(
            door_id=hr.door_id, changed=Changed.POSE | Changed.WIDTH, level=hr.level,
            x=hr.x - 0.25 * math.cos(hr.theta), y=hr.y - 0.25 * math.sin(hr.theta),
            theta=hr.theta, width=hr.width + 0.25,
        ),
        actor=MANAGER, reason="moved and widened for wheelchairs",
    )  # fmt: skip
    journal.add(
        world.moment(*WALLED_UP_AT),
        DoorRemoved(door_id=world.named(WALLED_UP)),
        actor=MANAGER, reason="walled up: rooms 3 and 4 became one",
    )  # fmt: skip
    _set(world, journal, "L1_clinic_b", DoorState.OFFLINE, (5, "10:00"), minutes=150,
         actor=MANAGER, reason="door drive being repaired")  # fmt: skip
    # Written down at night, typed in the next morning: known five hours after it happened.
    late = DoorUpdated(
        happened_ns=world.moment(6, "02:40"), door_id=world.named("L2_clinic_a"),
        changed=Changed.STATE, state=DoorState.OPEN,
    )  # fmt: skip
    world.truths[late.door_id].hold(
        world.moment(6, "02:40"), world.moment(6, "02:55"), DoorState.OPEN
    )
    journal.add(world.moment(6, "07:40"), late, actor=NURSE, source="night book",
                reason="stood open at night: delivery")  # fmt: skip


def _set(
    world: World, journal: Journal, name: str, state: DoorState, when: tuple[int, str], *,
    minutes: float, actor: str, reason: str,
) -> None:  # fmt: skip
    """Let somebody open or shut a door, for so long at least, and say so in the log."""
    door_id, start_ns = world.named(name), world.moment(*when)
    world.truths[door_id].hold(start_ns, start_ns + round(minutes * 60 * 10**9), state)
    update = DoorUpdated(
        happened_ns=start_ns, door_id=door_id, changed=Changed.STATE, state=state,
    )  # fmt: skip
    journal.add(start_ns + 12 * 10**9, update, actor=actor, reason=reason)


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
        ROBOT, world=world, routes=routes, home=HOME, home_level=LEVEL_2,
        lift={LEVEL_1: LIFT, LEVEL_2: LIFT}, sensor=DOOR_CAMERA, journal=journal, rng=rng,
    )  # fmt: skip
    upper, lower = (
        _stops(world, routes[level], level, start) for level, start in ((2, HOME), (1, LIFT))
    )
    for number, (day, hour) in enumerate(_schedule(), start=1):
        starts_ns = world.moment(day, f"{hour}:00") + round(rng.uniform(15, 240)) * 10**9
        robot.now_ns = max(starts_ns, robot.now_ns + 5 * 60 * 10**9)
        stops = [*upper, *lower] if number % 2 else [*reversed(upper), *reversed(lower)]
        if not (day < 5 and 6 <= hour <= 18):
            outside = world.named("L1_wc_1")  # behind the main entrance, which is locked soon
            stops = [stop for stop in stops if stop.door_id != outside]
        robot.patrol(number, _round_name(day, hour), stops)


def _schedule() -> Iterator[tuple[int, int]]:
    for day in range(DAYS):
        for hour in WORKDAY_ROUNDS if day < 5 else WEEKEND_ROUNDS:
            if (day, hour) != (0, 0):  # that night the building was still being imported
                yield day, hour


def _round_name(day: int, hour: int) -> str:
    night = not 6 <= hour < 21
    return "night round" if night else "weekend round" if day >= 5 else "day round"


def _stops(world: World, routes: FloorRoutes, level: int, start: Point) -> list[Stop]:
    """Return where to stop for each door of a level that one goes to look at, in a good order."""
    seen_from = {
        point: door.door_id
        for door in world.doors.values()
        if door.level == level and world.names[door.door_id] != FIRE_DOOR
        and (point := routes.viewpoint(door, start)) is not None
    }  # fmt: skip
    return [Stop(level, point, seen_from[point]) for point in routes.tour(start, list(seen_from))]


def _second_thoughts(world: World, journal: Journal) -> None:
    """Take back what turned out to be wrong: one misread, and one visit with a dirty lens."""
    store = world.named("L1_cleaning_supplies")

    def is_misread(event: Event) -> bool:
        return (
            isinstance(event, DoorObserved)
            and event.door_id == store
            and event.state is DoorState.OPEN
            and event.happened_ns is not None
            and world.truths[store].state(event.happened_ns) is DoorState.CLOSED
        )

    _, number = journal.find(is_misread)
    journal.retract(world.moment(5, "09:30"), number, number, actor=MANAGER,
                    reason="the store was locked all night: misread")  # fmt: skip

    def is_friday_night(event: Event) -> bool:
        late_ns = world.moment(4, "22:10")
        return (
            isinstance(event, DoorObserved)
            and event.happened_ns is not None
            and event.happened_ns >= late_ns
        )

    place, _ = journal.find(is_friday_night)
    first = sum(len(entry.events) for entry in journal[:place])
    last = first + sum(len(entry.events) for entry in journal[place : place + 6]) - 1
    journal.retract(world.moment(5, "09:45"), first, last, actor=MANAGER,
                    reason="six visits with a dirty lens")  # fmt: skip


def moments(journal: Journal, monday_ns: int) -> list[Moment]:
    """Return the moments whose state ships with the recording."""
    at = World(monday_ns, {}, {}, {}).moment
    _, first_removal = journal.find(lambda event: isinstance(event, DoorRemoved))
    return [
        Moment("Tuesday before dawn: all is shut", at_ns=at(1, "03:30")),
        Moment("Wednesday morning, before the fire door", at_ns=at(2, "08:59")),
        Moment("Thursday 15:00, with all that is known today", at_ns=at(3, "15:00")),
        Moment("Thursday 15:00 as believed then: the robot was cut off since 14:00",
               known_at_ns=at(3, "15:00")),
        Moment("the last event before a door was removed", event=first_removal - 1),
        Moment("Friday 23:00 as believed on Saturday at 9:00, before the lens was found dirty",
               at_ns=at(4, "23:00"), known_at_ns=at(5, "09:00")),
        Moment("the end"),
    ]  # fmt: skip
