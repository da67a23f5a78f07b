"""The office: three doors, one day, small enough to check by hand."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

from patrol_sim.expected import Moment
from patrol_sim.habits import EVERY_DAY, DoorTruth, Habit, Spell
from patrol_sim.journal import Entry, Journal
from patrol_sim.robot import Robot, Stop
from patrol_sim.routes import FloorRoutes, Point
from patrol_sim.sensor import Sensor
from patrol_sim.world import World
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import Changed, DoorAnnotated, DoorObserved, DoorUpdated, Event

TZ = "Europe/Vienna"
ROBOT = "tinyRobot1"
CELL_M = 0.1
LEVEL = 1
HOME: Point = (10.42, -5.57)
"""The plan's vertex tinyRobot1_charger, metres, frame `map`."""
HARDWARE_ROOM: Point = (20.92, -7.49)
MEETING_ROOM: Point = (5.34, -4.97)

DOOR_CAMERA = Sensor(
    "door_camera", accuracy_open=0.97, accuracy_closed=0.95, measures_opening=True, errs=False
)
MANAGER, RECEPTION = "facility manager", "receptionist"

OPEN, CLOSED = DoorState.OPEN, DoorState.CLOSED
TRUTH = {
    "main_door": [("00:00", CLOSED), ("07:55", OPEN), ("19:00", CLOSED)],
    "coe_door": [
        ("00:00", CLOSED), ("08:30", OPEN), ("11:50", CLOSED), ("13:10", OPEN),
        ("15:00", CLOSED), ("16:05", OPEN), ("18:20", CLOSED),
    ],
    "hardware_door": [("00:00", CLOSED), ("09:15", OPEN), ("12:00", CLOSED)],
}  # fmt: skip
"""How the doors really stood, local time."""

ROUNDS = (
    ("08:00", "morning round"),
    ("10:00", "round"),
    ("12:30", "round with a delivery to the hardware room"),
    ("15:10", "round with a delivery to the meeting room"),
    ("17:30", "evening round"),
    ("20:00", "night round"),
)


def tell(plan: Sequence[Event], monday_ns: int, rng: random.Random) -> Journal:
    """Return the day's commits, settled; see `clinic.tell`."""
    world = World.from_plan(plan, monday_ns)
    for name, changes in TRUTH.items():
        door_id = world.named(name)
        world.truths[door_id] = DoorTruth((world.moment(0, at), state) for at, state in changes)
    # From 15:00 to 16:00 there is a meeting behind coe_door: nobody opens.
    world.habits[world.named("coe_door")] = Habit(
        Spell(EVERY_DAY, 0, 24, 0.5, 1), Spell([0], 15, 16, 0.01, 0.1)
    )

    journal = Journal()
    journal.add(world.moment(0, "07:30"), *plan, actor="survey", source="office.building.yaml",
                reason="first import of the building")  # fmt: skip
    _people(world, journal)
    _rounds(world, journal, rng)
    journal.settle()
    _misread(world, journal)
    return journal


def _people(world: World, journal: Journal) -> None:
    main, coe, hardware = (world.named(name) for name in TRUTH)
    journal.add(
        world.moment(0, "07:40"),
        DoorAnnotated(door_id=coe, key="rooms", value="hall, centre of excellence"),
        DoorAnnotated(door_id=hardware, key="rooms", value="hall, hardware room"),
        actor=MANAGER, reason="names of the rooms",
    )  # fmt: skip
    journal.add(world.moment(0, "07:55"), _stands(main, OPEN),
                actor=MANAGER, reason="opened for the day")  # fmt: skip
    journal.add(
        world.moment(0, "09:00"),
        DoorUpdated(door_id=main, changed=Changed.PROB_OPEN | Changed.PROB_CLOSED,
                    prob_open=0.9, prob_closed=0.1),
        actor=MANAGER, reason="open all day",
    )  # fmt: skip
    # Told an hour later: what the robot believed in between was wrong.
    opened = replace(_stands(coe, OPEN), happened_ns=world.moment(0, "13:10"))
    journal.add(world.moment(0, "14:10"), opened,
                actor=RECEPTION, reason="unlocked after lunch, written down late")  # fmt: skip
    journal.add(world.moment(0, "19:00"), _stands(main, CLOSED),
                actor=MANAGER, reason="locked for the night")  # fmt: skip


def _stands(door_id: DoorId, state: DoorState) -> DoorUpdated:
    return DoorUpdated(door_id=door_id, changed=Changed.STATE, state=state)


def _rounds(world: World, journal: Journal, rng: random.Random) -> None:
    portals = [world.named("coe_door"), world.named("hardware_door")]
    routes = FloorRoutes(world.floors[LEVEL], world.doors.values(), portals, CELL_M)
    robot = Robot(
        ROBOT, world=world, routes={LEVEL: routes}, home=HOME, home_level=LEVEL, lift={},
        sensor=DOOR_CAMERA, journal=journal, rng=rng,
    )  # fmt: skip
    seen_from = {
        point: door.door_id
        for door in world.doors.values()
        if (point := routes.viewpoint(door, HOME)) is not None
    }
    looks = [Stop(LEVEL, point, seen_from[point]) for point in routes.tour(HOME, seen_from)]
    errands = {2: Stop(LEVEL, HARDWARE_ROOM, stay_s=90), 3: Stop(LEVEL, MEETING_ROOM, stay_s=90)}
    for index, (starts, name) in enumerate(ROUNDS):
        robot.now_ns = world.moment(0, starts)
        errand = [errands[index]] if index in errands else []
        robot.patrol(index + 1, name, [*looks, *errand])


def _misread(world: World, journal: Journal) -> None:
    """Let the camera err once, in the second round, and let somebody take that back."""
    main, round_ns = world.named("main_door"), world.moment(0, "10:00")

    def is_sighting(event: Event) -> bool:
        return (
            isinstance(event, DoorObserved)
            and event.door_id == main
            and event.happened_ns is not None
            and event.happened_ns > round_ns
        )

    place, number = journal.find(is_sighting)
    entry = journal[place]
    events = tuple(
        replace(event, state=CLOSED, opening=0.0)
        if isinstance(event, DoorObserved) and event.door_id == main else event
        for event in entry.events
    )  # fmt: skip
    journal[place] = Entry(entry.recorded_ns, events, entry.note)
    journal.retract(world.moment(0, "10:40"), number, number, actor=MANAGER,
                    reason="it was open: sun on the glass")  # fmt: skip


def moments(journal: Journal, monday_ns: int) -> list[Moment]:
    """Return the moments whose state ships with the recording."""
    at = World(monday_ns, {}, {}, {}).moment
    _, first_sighting = journal.find(lambda event: isinstance(event, DoorObserved))
    return [
        Moment("before the first round", at_ns=at(0, "07:50")),
        Moment("the first sighting", event=first_sighting),
        Moment("10:30 as believed then: the sun was on the glass of main_door",
               known_at_ns=at(0, "10:30")),
        Moment("10:30 with all that is known today", at_ns=at(0, "10:30")),
        Moment("14:00 as believed then: coe_door was last seen shut", known_at_ns=at(0, "14:00")),
        Moment("14:00 with all that is known today: it was open", at_ns=at(0, "14:00")),
        Moment("12:31, in the middle of a round, by what was known at 14:00",
               at_ns=at(0, "12:31"), known_at_ns=at(0, "14:00")),
        Moment("the end: locked for the night"),
    ]  # fmt: skip
