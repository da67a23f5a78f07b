"""How doors live: opened and closed at random, by rates that follow the hours of the week.

The world's truth, which no robot sees: a continuous-time two-state chain for each door, whose
rates hold for half an hour at a time. Hours are local and count from Monday 00:00; the week has
no clock change.
"""

from __future__ import annotations

import random
import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

from semmap_log.core.model.doors import DoorState

HOUR_NS = 3_600_000_000_000
SLOTS = 7 * 48
"""Half hours in a week."""

WEEKDAYS = range(5)
EVERY_DAY = range(7)
LOCKED_BELOW = 0.05
"""A door that is open for a smaller share of some half hour is locked then."""


@dataclass(frozen=True, slots=True)
class Spell:
    """Hours in which a door behaves in one way."""

    days: Iterable[int]
    """0 = Monday."""
    start_h: float
    end_h: float
    share: float
    """Of the time open, above 0 and below 1."""
    pace: float
    """Changes an hour, openings and closings together."""


class Habit:
    """A door's week; later spells lie over earlier ones."""

    def __init__(self, *spells: Spell) -> None:
        self.share = [0.01] * SLOTS
        self.pace = [0.03] * SLOTS
        for spell in spells:
            for day in spell.days:
                for slot in range(round(spell.start_h * 2), round(spell.end_h * 2)):
                    self.share[day * 48 + slot] = spell.share
                    self.pace[day * 48 + slot] = spell.pace

    def is_locked(self, hour: float) -> bool:
        """Tell whether the door is kept shut at that hour of the week."""
        return self.share[int(hour * 2) % SLOTS] < LOCKED_BELOW

    def leaving_rate(self, state: DoorState, slot: int) -> float:
        """Return how often an hour a door in that state would leave it."""
        share, pace = self.share[slot % SLOTS], self.pace[slot % SLOTS]
        return pace / (2 * share) if state is DoorState.OPEN else pace / (2 * (1 - share))


class DoorTruth:
    """How a door really stood, from a first moment on."""

    def __init__(self, changes: Iterable[tuple[int, DoorState]]) -> None:
        """Take (when, state) in order of time; before the first, that state held already."""
        self._times, self._states = map(list, zip(*changes, strict=True))

    def state(self, at_ns: int) -> DoorState:
        """Return how it stood then."""
        return self._states[max(0, bisect_right(self._times, at_ns) - 1)]

    def last_change_ns(self, at_ns: int) -> int:
        """Return when it last changed before then."""
        return self._times[max(0, bisect_right(self._times, at_ns) - 1)]

    def changes(self, start_ns: int, end_ns: int) -> list[tuple[int, DoorState]]:
        """Return how it changed after `start_ns`, up to `end_ns`."""
        first, last = (bisect_right(self._times, moment) for moment in (start_ns, end_ns))
        return list(zip(self._times[first:last], self._states[first:last], strict=True))

    def hold(self, start_ns: int, end_ns: int, state: DoorState) -> None:
        """Let it stand so from start to end, whatever its habit; then its habit has it back."""
        first, last = (bisect_right(self._times, moment) for moment in (start_ns, end_ns))
        before, after = self.state(start_ns), self.state(end_ns)
        held = [(start_ns, state)] if state is not before else []
        if after is not state:
            held.append((end_ns, after))
        self._times[first:last] = [when for when, _ in held]
        self._states[first:last] = [new for _, new in held]


def live(habit: Habit, start_ns: int, end_ns: int, rng: random.Random) -> DoorTruth:
    """Return one life of a door with that habit, from `start_ns`, a Monday 00:00, on."""
    state = DoorState.OPEN if rng.random() < habit.share[0] else DoorState.CLOSED
    changes = [(start_ns, state)]
    patience = rng.expovariate(1)
    now_h, end_h = 0.0, (end_ns - start_ns) / HOUR_NS
    while now_h < end_h:
        slot = int(now_h * 2)
        rate = habit.leaving_rate(state, slot)
        stays_h = (slot + 1) / 2 - now_h
        if patience > rate * stays_h:
            patience -= rate * stays_h
            now_h = (slot + 1) / 2
            continue
        now_h += patience / rate
        state = DoorState.CLOSED if state is DoorState.OPEN else DoorState.OPEN
        changes.append((start_ns + round(now_h * 3_600_000) * 1_000_000, state))
        patience = rng.expovariate(1)
    return DoorTruth(changes)


def habit_of(name: str, rng: random.Random) -> Habit:
    """Return a habit that fits the name of one of the clinic's doors."""
    for pattern, habit in _HABITS:
        if re.search(pattern, name):
            return habit(rng)
    return _staff_door(rng)


def _entrance(_: random.Random) -> Habit:
    """Stands open by day; half a day on Saturday; shut on Sunday."""
    return Habit(
        Spell(EVERY_DAY, 0, 24, 0.005, 0.01),
        Spell(WEEKDAYS, 6.5, 20, 0.93, 2),
        Spell([5], 8, 14, 0.85, 2),
    )


def _upper_entrance(_: random.Random) -> Habit:
    """Visitors come every day from ten to eight; staff at any hour."""
    return Habit(Spell(EVERY_DAY, 0, 24, 0.08, 0.8), Spell(EVERY_DAY, 10, 20, 0.7, 5))


def _ward_room(rng: random.Random) -> Habit:
    """Open by day, seven days a week; a rest after lunch; ajar in some nights."""
    wakes, sleeps = rng.choice([5.5, 6, 6.5]), rng.choice([20, 20.5, 21, 21.5])
    return Habit(
        Spell(EVERY_DAY, 0, 24, rng.choice([0.06, 0.1, 0.3]), 0.5),
        Spell(EVERY_DAY, wakes, sleeps, rng.uniform(0.6, 0.9), rng.uniform(1, 4)),
        Spell(EVERY_DAY, 13, 14.5, 0.12, 0.8),
    )


def _consulting_room(rng: random.Random) -> Habit:
    """Open in its doctor's hours, with a lunch break and, for most, an afternoon off."""
    starts, ends = rng.choice([7.5, 8, 8.5, 9]), rng.choice([16, 16.5, 17, 18])
    lunch, back = rng.choice([(12, 13), (12, 12.5), (12.5, 13.5), (13, 14)])
    share, pace = rng.choice([(0.2, 3), (0.4, 6), (0.6, 5), (0.85, 1.5)])
    shut = (0.02, 0.1)
    # Some doors stick: whoever leaves does not pull them shut, and nobody else does.
    night = (0.35, 0.04) if rng.random() < 0.1 else shut
    on_call = rng.random() < 0.1
    return Habit(
        Spell(EVERY_DAY, 0, 24, *night),
        Spell(WEEKDAYS, starts, ends, share, pace),
        Spell(WEEKDAYS, lunch, back, 0.1, 1),
        Spell([rng.choice(WEEKDAYS)] if rng.random() < 0.6 else [], 13, ends, *shut),
        Spell([5] if on_call else [], 9, 13, share, pace),
    )


def _back_door(rng: random.Random) -> Habit:
    """A consulting room's door to the staff corridor: left open by some, kept shut by others."""
    share, pace = rng.choice([(0.1, 2), (0.25, 8), (0.5, 3), (0.9, 0.7)])
    return Habit(
        Spell(EVERY_DAY, 0, 24, 0.03, 0.1),
        Spell(WEEKDAYS, rng.choice([7, 7.5, 8]), rng.choice([16.5, 17, 18]), share, pace),
    )


def _treatment_room(rng: random.Random) -> Habit:
    """In and out all day, less on Saturday."""
    share, pace = rng.uniform(0.3, 0.6), rng.uniform(6, 12)
    return Habit(
        Spell(EVERY_DAY, 0, 24, 0.03, 0.15),
        Spell(WEEKDAYS, 7, 18, share, pace),
        Spell([5], 8, 12, share / 2, pace / 2),
    )


def _store_room(rng: random.Random) -> Habit:
    """Nearly always closed; opened for minutes when the cleaners or fitters come."""
    comes = rng.choice([5, 5.5, 18, 18.5])
    return Habit(
        Spell(EVERY_DAY, 0, 24, 0.004, 0.03),
        Spell(WEEKDAYS, comes, comes + 1.5, 0.25, 6),
    )


def _isolation_room(_: random.Random) -> Habit:
    """Held at negative pressure: closes itself behind everybody."""
    return Habit(Spell(EVERY_DAY, 0, 24, 0.01, 0.3), Spell(EVERY_DAY, 7, 20, 0.04, 4))


def _washroom(_: random.Random) -> Habit:
    """A spring closes it; many people, short openings."""
    return Habit(Spell(EVERY_DAY, 0, 24, 0.02, 0.5), Spell(EVERY_DAY, 6, 20, 0.12, 14))


def _office(_: random.Random) -> Habit:
    """Office hours, early end on Friday."""
    return Habit(
        Spell(EVERY_DAY, 0, 24, 0.01, 0.03),
        Spell(range(4), 8, 16.5, 0.65, 3),
        Spell([4], 8, 13, 0.65, 3),
    )


def _staff_door(_: random.Random) -> Habit:
    """A door across a staff corridor: never locked, wedged open while the house is busy."""
    return Habit(Spell(EVERY_DAY, 0, 24, 0.15, 1), Spell(WEEKDAYS, 6.5, 19, 0.8, 2))


def _fire_door(_: random.Random) -> Habit:
    """Held open by a magnet by day, released at night."""
    return Habit(Spell(EVERY_DAY, 0, 24, 0.06, 0.4), Spell(EVERY_DAY, 6, 21, 0.97, 0.3))


_HABITS = (
    (r"^L1_clinic_", _entrance),
    (r"^L2_clinic_", _upper_entrance),
    (r"^L2_left_consult.*_outer$", _ward_room),
    (r"_outer$|_right_consult$", _consulting_room),
    (r"_rm_\d+_inner$", _back_door),
    (r"_treatment|_procedure|_counsel", _treatment_room),
    (r"_ahu$|_cleaning_supplies$", _store_room),
    (r"_negative_air_pressure$", _isolation_room),
    (r"_wc_", _washroom),
    (r"_hr$", _office),
    (r"_fire_door", _fire_door),
)
"""What is said of a name first holds; `m` and the `_inner` doors are corridor doors."""
