"""What people do in the clinic that week, and what they tell the log about it."""

from __future__ import annotations

import math
import random
import re
from dataclasses import dataclass

from patrol_sim.journal import Journal
from patrol_sim.world import World
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorRemoved,
    DoorUpdated,
    Event,
)

MINUTE_NS = 60 * 10**9
MANAGER, NURSE = "facility manager", "ward nurse"

FIRE_DOOR, FIRE_DOOR_BUILT = "L1_fire_door_west", (2, "09:00")
WALLED_UP, WALLED_UP_AT = "L1_left_counsel_4", (4, "16:00")
"""Days count from 0 = Monday, times are local."""


def build(world: World) -> None:
    """Let the fire door come on Wednesday and a counselling room's door go on Friday."""
    door_id = DoorId(max(world.doors) + 1)
    world.doors[door_id] = DoorAdded(
        door_id=door_id, level=1, x=11.875, y=-30.9, theta=0.0, width=2.375,
        state=DoorState.OPEN, prob_open=0.7, prob_closed=0.3,
    )  # fmt: skip
    world.names[door_id] = FIRE_DOOR
    world.built_ns[door_id] = world.moment(*FIRE_DOOR_BUILT)
    world.gone_ns[world.named(WALLED_UP)] = world.moment(*WALLED_UP_AT)


@dataclass(frozen=True, slots=True)
class Deed:
    """Somebody opens or shuts a door, and it stays so for a while."""

    name: str
    state: DoorState
    start_ns: int
    minutes: int


def act(world: World, journal: Journal, rng: random.Random) -> None:
    """Write down all that people do and report; what they do to a door becomes true."""
    _open_and_lock(world, journal)
    _let_patients_sleep(world, journal, rng)
    _describe(world, journal)
    _rebuild(world, journal)
    _repair(world, journal)
    _remember_late(world, journal)


def _open_and_lock(world: World, journal: Journal) -> None:
    """The main entrances, on working days and on Saturday."""
    for day in range(6):
        opens, closes = ("06:30", "20:00") if day < 5 else ("08:00", "14:00")
        for minute, name in enumerate(("L1_clinic_a", "L1_clinic_b")):
            walk_ns = minute * MINUTE_NS
            opened = Deed(name, DoorState.OPEN, world.moment(day, opens) + walk_ns, 10)
            locked = Deed(name, DoorState.CLOSED, world.moment(day, closes) + walk_ns, 300)
            _do(world, journal, opened, actor=MANAGER, reason="opened for the day")
            _do(world, journal, locked, actor=MANAGER, reason="locked for the night")


def _let_patients_sleep(world: World, journal: Journal, rng: random.Random) -> None:
    """Three ward rooms, other ones every evening."""
    wards = [name for name in world.names.values() if re.match("L2_left_consult.*_outer", name)]
    for day in range(7):
        for nth, name in enumerate(rng.sample(wards, 3)):
            start_ns = world.moment(day, "21:05") + 4 * nth * MINUTE_NS
            asleep = Deed(name, DoorState.CLOSED, start_ns, 480)
            _do(world, journal, asleep, actor=NURSE, reason="patient asleep: keep shut")


def _describe(world: World, journal: Journal) -> None:
    """On Tuesday: what to expect of store rooms, and a better name for a door."""
    stores = [i for i, name in world.names.items() if name.endswith(("_ahu", "_supplies"))]
    for nth, door_id in enumerate(stores):
        seldom_open = DoorUpdated(
            door_id=door_id, changed=Changed.PROB_OPEN | Changed.PROB_CLOSED,
            prob_open=0.02, prob_closed=0.98,
        )  # fmt: skip
        journal.add(world.moment(1, f"11:{20 + nth}"), seldom_open,
                    actor=MANAGER, reason="store rooms are kept locked")  # fmt: skip
    better_name = DoorAnnotated(door_id=world.named("m"), key="name", value="L2_left_inner")
    journal.add(world.moment(1, "11:30"), better_name, actor=MANAGER, reason="the plan calls it m")


def _rebuild(world: World, journal: Journal) -> None:
    """A door added on Wednesday, one moved on Thursday, one removed on Friday."""
    fire_door = world.doors[world.named(FIRE_DOOR)]
    journal.add(
        world.moment(*FIRE_DOOR_BUILT),
        fire_door,
        DoorAnnotated(door_id=fire_door.door_id, key="name", value=FIRE_DOOR),
        DoorAnnotated(door_id=fire_door.door_id, key="kind", value="double_hinged"),
        actor=MANAGER, reason="new fire door in the western corridor",
    )  # fmt: skip
    hr = world.doors[world.named("L1_hr")]
    wider = DoorUpdated(
        door_id=hr.door_id, changed=Changed.POSE | Changed.WIDTH, level=hr.level,
        x=hr.x - 0.25 * math.cos(hr.theta), y=hr.y - 0.25 * math.sin(hr.theta),
        theta=hr.theta, width=hr.width + 0.25,
    )  # fmt: skip
    journal.add(world.moment(3, "07:45"), wider,
                actor=MANAGER, reason="moved and widened for wheelchairs")  # fmt: skip
    journal.add(world.moment(*WALLED_UP_AT), DoorRemoved(door_id=world.named(WALLED_UP)),
                actor=MANAGER, reason="walled up: rooms 3 and 4 became one")  # fmt: skip


def _repair(world: World, journal: Journal) -> None:
    repair = Deed("L1_clinic_b", DoorState.OFFLINE, world.moment(5, "10:00"), 150)
    _do(world, journal, repair, actor=MANAGER, reason="door drive being repaired")


def _remember_late(world: World, journal: Journal) -> None:
    """Written down at night, typed in the next morning: known five hours after it happened."""
    delivery = Deed("L2_clinic_a", DoorState.OPEN, world.moment(6, "02:40"), 15)
    _do(world, journal, delivery, told_ns=world.moment(6, "07:40"),
        actor=NURSE, reason="stood open at night: delivery")  # fmt: skip


def _do(
    world: World, journal: Journal, deed: Deed, *, actor: str, reason: str, told_ns: int = 0
) -> None:
    """Let somebody do it, and tell the log: seconds later, unless said otherwise."""
    door_id = world.named(deed.name)
    world.truths[door_id].hold(deed.start_ns, deed.start_ns + deed.minutes * MINUTE_NS, deed.state)
    update = DoorUpdated(
        happened_ns=deed.start_ns, door_id=door_id, changed=Changed.STATE, state=deed.state
    )
    journal.add(told_ns or deed.start_ns + 12 * 10**9, update, actor=actor, reason=reason)


def take_back(world: World, journal: Journal) -> None:
    """On Saturday, retract what was wrong in a settled journal: a misread, and a dirty lens."""
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
    journal.retract(world.moment(5, "09:30"), number, number,
                    actor=MANAGER, reason="the store was locked: misread")  # fmt: skip

    def is_late_on_friday(event: Event) -> bool:
        since_ns = world.moment(4, "21:10")
        return isinstance(event, DoorObserved) and (event.happened_ns or 0) >= since_ns

    place, _ = journal.find(is_late_on_friday)
    first = sum(len(entry.events) for entry in journal[:place])
    last = first + sum(len(entry.events) for entry in journal[place : place + 6]) - 1
    journal.retract(world.moment(5, "09:45"), first, last,
                    actor=MANAGER, reason="six visits with a dirty lens")  # fmt: skip
