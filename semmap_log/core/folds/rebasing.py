"""Rebases a level onto a new map of the building: where each of its doors lies there.

Everything in a log is in the frame `map`. A new map has another origin, and is rotated against the
old one. From the moment of the change on, the level has the new floor plan, and its doors lie where
the transform puts them, or where they were measured again. Reports from before stay as they are,
and belong to the old plan. Reports from later times are in the new frame already.

Also whether repeated events are those that are stored, and how two maps of one place lie to each
other, from points that were measured in both.

The rigid transform with the least sum of squared residuals: Arun, Huang and Blostein,
"Least-Squares Fitting of Two 3-D Point Sets", PAMI 1987; Umeyama, PAMI 1991, without his scale. In
the plane it has a closed form: with points as complex numbers, counted from their means, old a and
new b, it turns by the angle of sum(conj(a) b).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import NamedTuple

import numpy as np

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.messages import encode
from semmap_log.core.model.doors import NAN, Door, DoorId, DoorMap, is_given
from semmap_log.core.model.events import DoorAnnotated, DoorUpdated, Event, FloorMap
from semmap_log.core.model.meaning import PLACING, Changed
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import CommandError


class MeasuredDoor(NamedTuple):
    """Where a door lies, as somebody measured it in the new map."""

    x: float
    y: float
    theta: float
    width: float = NAN
    """NaN: as it was."""


@dataclass(frozen=True, slots=True)
class MovedDoor:
    """A door, and where it lies in the new map."""

    before: Door
    """In the old one; unplaced, if it had no place."""
    after: Door
    is_measured: bool
    """It was measured again; else the transform puts it there."""
    off_m: float
    """How far a measured door starts from where the transform puts it; NaN: the transform did."""
    is_on_map: bool
    """Both ends of its line lie on the new map's cells."""


@dataclass(frozen=True, slots=True)
class RebasePlan:
    """What a rebase does, and what it leaves alone."""

    level: int
    floor: FloorMap
    """The new map."""
    by: RigidTransform
    """From the old map's frame to the new one's."""
    doors: tuple[MovedDoor, ...]
    """Ids ascending."""
    unplaced: tuple[DoorId, ...]
    """Doors of the level without a place, before and after."""
    elsewhere: tuple[DoorId, ...]
    """Doors of other levels."""
    placed_later: tuple[DoorId, ...]
    """Doors that were put in their places after that moment: they lie in the new map already."""

    def events(self, happened_ns: int | None) -> Iterator[Event]:
        """Yield the events of the one commit: the map, then each door's place."""
        yield replace(self.floor, level=self.level, happened_ns=happened_ns)
        for door in self.doors:
            after = door.after
            sets = Changed.POSE if after.width == door.before.width else PLACING
            yield DoorUpdated(
                door_id=after.door_id, changed=sets, level=self.level, x=after.x, y=after.y,
                theta=after.theta, width=after.width, happened_ns=happened_ns,
            )  # fmt: skip


@dataclass(frozen=True, slots=True)
class MapStates:
    """The door map at the moment of the change, and with all reports from later times."""

    then: DoorMapState
    now: DoorMapState
    there: FloorMap | None
    """The floor plan of the level at that moment."""
    log: PurePath
    """Where the log is, for messages."""


def plan_rebase(
    states: MapStates,
    floor: FloorMap,
    by: RigidTransform,
    measured: Mapping[DoorId, MeasuredDoor],
    *,
    level: int,
) -> RebasePlan:
    """Return where the doors of a level lie in a new map.

    Args:
        states: The doors, before and after.
        floor: The new map.
        by: From the old map's frame to the new one's.
        measured: Doors that were measured again, in the new map's frame.
        level: The number of the level.

    Raises:
        CommandError: The level has that very map already, or another from a later time; or a
            measured door is not on it then.
    """
    then = states.then.door_map()
    _check_map(states, then, floor, level)
    here = {i: door for i, door in then.doors.items() if door.level == level}
    _check_measured(measured, here, then, level)
    moved = [_moved(door, by, measured.get(i), floor) for i, door in here.items()]
    later = {i for i in states.now.door_map().doors if _is_placed_later(states, i)}
    return RebasePlan(
        level=level, floor=floor, by=by,
        doors=tuple(door for door in moved if door.after.is_placed),
        unplaced=tuple(door.after.door_id for door in moved if not door.after.is_placed),
        elsewhere=tuple(i for i, door in then.doors.items() if door.level != level),
        placed_later=tuple(sorted(i for i in later if states.now.door_map()[i].level == level)),
    )  # fmt: skip


def _check_map(states: MapStates, then: DoorMap, floor: FloorMap, level: int) -> None:
    """Check that the map is new: rebasing to the same one again would move doors twice."""
    name = then.level_name(level)
    if states.there is not None and are_same([replace(floor, level=level)], [states.there]):
        number = then.levels[level].floor_map_event
        back = command_line("retract", states.log, str(number))
        raise CommandError(
            f"level {name} has this very map already, by event {number}: its doors would be moved "
            f"twice. If the map came without its doors, take it back, and call again: {back}"
        )
    known = states.now.door_map().levels.get(level)
    before = then.levels.get(level)
    later = None if known is None else known.floor_map_event
    if later is not None and (before is None or before.floor_map_event != later):
        raise CommandError(
            f"level {name} has another floor map from a later time, by event {later}; expected a "
            "later moment: leave --at out, or give a later one."
        )


def _check_measured(
    measured: Mapping[DoorId, MeasuredDoor], here: Mapping[DoorId, Door], then: DoorMap, level: int
) -> None:
    for door_id, at in measured.items():
        if door_id not in here:
            what = f"is on level {then.doors[door_id].level}" if door_id in then.doors else "is not"
            raise CommandError(
                f"door {door_id} {what} in the map at that moment; expected measured doors of "
                f"level {then.level_name(level)} alone."
            )
        if not all(map(math.isfinite, at[:3])) or (
            math.isnan(at.width) and not here[door_id].is_placed
        ):
            raise CommandError(
                f"door {door_id}: expected a measured door with finite x, y and theta, and with a "
                f"width where it had no place, got {tuple(at)}."
            )


def _is_placed_later(states: MapStates, door_id: DoorId) -> bool:
    """Return whether a door got its place after the moment of the change."""
    placed = states.now.stamp(door_id, "pose")
    return placed is not None and placed != states.then.stamp(door_id, "pose")


def _moved(
    door: Door, by: RigidTransform, measured: MeasuredDoor | None, floor: FloorMap
) -> MovedDoor:
    x, y, theta = by.moved(door.x, door.y, door.theta)
    after = replace(door, x=float(x), y=float(y), theta=float(theta))
    off_m = NAN
    if measured is not None:
        off_m = math.hypot(measured.x - after.x, measured.y - after.y)
        width = door.width if math.isnan(measured.width) else measured.width
        after = replace(door, x=measured.x, y=measured.y, theta=measured.theta, width=width)
    is_on_map = all(_is_on(floor, *end) for end in (after.start, after.end))
    return MovedDoor(door, after, measured is not None, off_m, is_on_map)


def _is_on(floor: FloorMap, x: float, y: float) -> bool:
    """Return whether a point is on a floor map's cells, which may be turned about their corner."""
    cos, sin = math.cos(floor.origin_theta), math.sin(floor.origin_theta)
    right, up = x - floor.origin_x, y - floor.origin_y
    rows, columns = floor.cells.shape
    along, across = cos * right + sin * up, cos * up - sin * right
    is_on: bool = 0 <= along < columns * floor.resolution and 0 <= across < rows * floor.resolution
    return is_on


SAME_ANGLE = 1e-6
"""Radians: what going through a quaternion may change."""


def are_same(given: Sequence[Event], stored: Sequence[Event]) -> bool:
    """Return whether the given events are those that are stored.

    Salts do not count, nor does a happened time or a level that was not given: the log set it.
    """
    return len(given) == len(stored) and all(map(_is_same, given, stored))


def _is_same(given: Event, stored: Event) -> bool:
    if type(given) is not type(stored):
        return False
    if given.happened_ns not in (None, stored.happened_ns):
        return False
    if not is_given(getattr(given, "level", 0)):  # the log set it
        given = replace(given, level=stored.level)  # type: ignore[call-arg,attr-defined]
    if isinstance(given, FloorMap) and isinstance(stored, FloorMap):
        return _is_same_map(given, stored)
    return encode(_unsalted(given), 0) == encode(_unsalted(stored), 0)


def _is_same_map(given: FloorMap, stored: FloorMap) -> bool:
    """Compare two floor plans; the angle of one that is stored went through a quaternion."""
    return (
        given.level == stored.level
        and np.float32(given.resolution) == np.float32(stored.resolution)
        and (given.origin_x, given.origin_y) == (stored.origin_x, stored.origin_y)
        and abs(math.remainder(given.origin_theta - stored.origin_theta, math.tau)) < SAME_ANGLE
        and np.array_equal(given.cells, stored.cells)
    )


def _unsalted(event: Event) -> Event:
    return replace(event, salt=b"") if isinstance(event, DoorAnnotated) else event


MOST_RESIDUAL_M = 0.3
"""By default, a pair that is farther off is refused: about the error of a person who clicks into
two maps, and of the maps themselves."""
MOST_PAIRS = 1000
LEAST_SPOILING_M = 0.05
"""One cell of most maps: less than that, no pair is worth a word."""
SPOILS = 3
"""A pair spoils a fit if without it the greatest residual is less than a third."""
LEAST_SCALE = 0.005
"""So far from 1 a scale is worth a word: 0.25 m in a corridor of 50 m."""


@dataclass(frozen=True, slots=True)
class PointPair:
    """A point in both maps, metres."""

    name: str
    """What people call it: its name, or its line."""
    old_x: float
    old_y: float
    new_x: float
    new_y: float


@dataclass(frozen=True, slots=True)
class MapFit:
    """A fitted transform, and how well each pair fits it."""

    pairs: tuple[PointPair, ...]
    transform: RigidTransform
    residuals_m: tuple[float, ...]
    """How far each old point, once moved, lies from the new one."""
    misfits: tuple[str, ...]
    """Names of the pairs that do not fit the others."""
    without_misfits_m: float
    """The greatest residual of a fit without them; NaN: there are none."""
    hints: tuple[str, ...]
    """What may be wrong with the maps themselves: one is mirrored, or has another scale."""

    @property
    def worst_m(self) -> float:
        """The greatest residual."""
        return max(self.residuals_m)


def fit_maps(pairs: Sequence[PointPair], *, most_residual_m: float = MOST_RESIDUAL_M) -> MapFit:
    """Return the best rigid transform from the old map to the new one, whatever its residuals.

    Args:
        pairs: Points in both.
        most_residual_m: What is farther off does not fit.

    Raises:
        CommandError: There are less than two pairs, or all of them at one place, or too many.
    """
    _check(pairs)
    old, new = _points(pairs)
    transform = _rigid(old, new)
    residuals = _residuals(transform, old, new)
    misfits = _misfits(old, new, residuals, most_residual_m)
    kept = np.setdiff1d(np.arange(len(pairs)), misfits)
    without = _worst(old[kept], new[kept]) if misfits else math.nan
    return MapFit(
        pairs=tuple(pairs), transform=transform, residuals_m=tuple(residuals.tolist()),
        misfits=tuple(pairs[i].name for i in misfits), without_misfits_m=without,
        hints=tuple(_hints(old, new)),
    )  # fmt: skip


def check_fit(fit: MapFit, *, most_residual_m: float = MOST_RESIDUAL_M) -> None:
    """Check that every pair fits.

    Raises:
        CommandError: One does not; the message names it, and says what the others would give.
    """
    if fit.worst_m <= most_residual_m:
        return
    far = zip(fit.pairs, fit.residuals_m, strict=True)
    worst = [f"{pair.name}: {off:.2f} m" for pair, off in far if off > most_residual_m]
    said = (
        f"the pairs: expected residuals of at most {most_residual_m:g} m, got {', '.join(worst)}. "
    )
    if len(fit.pairs) == 2:
        said += "The two points are farther from each other in one map than in the other"
    elif fit.misfits and not math.isnan(fit.without_misfits_m):
        them = "it" if len(fit.misfits) == 1 else "them"
        said += (
            f"What does not fit the others: {', '.join(fit.misfits)}; without {them} the greatest "
            f"residual is {fit.without_misfits_m:.2f} m"
        )
    else:
        said += "No two thirds of them fit each other"
    hints = "".join(f" {hint}" for hint in fit.hints)
    raise CommandError(f"{said}.{hints} Measure such points again, or give --most-residual.")


def _check(pairs: Sequence[PointPair]) -> None:
    if not 2 <= len(pairs) <= MOST_PAIRS:
        raise CommandError(
            f"the pairs: expected 2 to {MOST_PAIRS:,} points in both maps, "
            f"got {counted(len(pairs), 'pair')}."
        )
    for which, points in zip(("old", "new"), _points(pairs), strict=True):
        if float(np.abs(points - points[0]).max()) < LEAST_SPOILING_M:
            raise CommandError(
                "the pairs: expected points that are far apart, best at opposite ends of the map; "
                f"in the {which} map all are within {LEAST_SPOILING_M:g} m, too close to give a "
                "direction."
            )


Points = np.ndarray
"""complex128: x + iy, metres."""


def _points(pairs: Iterable[PointPair]) -> tuple[Points, Points]:
    pairs = list(pairs)
    return (
        np.array([complex(p.old_x, p.old_y) for p in pairs]),
        np.array([complex(p.new_x, p.new_y) for p in pairs]),
    )


def _sum(values: Points) -> complex:
    return complex(math.fsum(values.real.tolist()), math.fsum(values.imag.tolist()))


def _rigid(old: Points, new: Points) -> RigidTransform:
    """Return the best transform; of points that are all at one place, one without a turn."""
    middle, goal = _sum(old) / len(old), _sum(new) / len(new)
    theta = cmath.phase(_sum(np.conj(old - middle) * (new - goal)))
    shift = goal - cmath.rect(1.0, theta) * middle
    return RigidTransform(shift.real, shift.imag, theta)


def _residuals(transform: RigidTransform, old: Points, new: Points) -> np.ndarray:
    x, y, _ = transform.moved(old.real, old.imag, 0.0)
    off: np.ndarray = np.hypot(x - new.real, y - new.imag)
    return off


def _worst(old: Points, new: Points) -> float:
    return float(_residuals(_rigid(old, new), old, new).max())


def _misfits(old: Points, new: Points, residuals: np.ndarray, most_m: float) -> list[int]:
    """Return the pairs that do not fit the others; none where most of them do not.

    Of all transforms that two pairs define, the one that most pairs fit within `most_m` decides
    (RANSAC with every sample drawn: Fischler and Bolles 1981). If all fit, only a pair counts
    without which the others fit much better.
    """
    if len(old) < 3 or residuals.max() <= LEAST_SPOILING_M:
        return []
    if residuals.max() <= most_m:
        return _spoiler(old, new, float(residuals.max()))
    fits = _largest_consensus(old, new, most_m)
    return np.flatnonzero(~fits).tolist() if fits.sum() * 3 >= len(old) * 2 else []


def _spoiler(old: Points, new: Points, worst_m: float) -> list[int]:
    without = [_worst(np.delete(old, i), np.delete(new, i)) for i in range(len(old))]
    best = int(np.argmin(without))
    return [best] if len(old) > 3 and without[best] * SPOILS < worst_m else []


def _largest_consensus(old: Points, new: Points, most_m: float) -> np.ndarray:
    """Return which pairs fit the transform that most pairs fit; of several, the closest fit."""
    best, key = np.zeros(len(old), np.bool_), (0, 0.0)
    for i in range(len(old) - 1):
        turn = np.conj(old[i + 1 :] - old[i]) * (new[i + 1 :] - new[i])
        turn = np.where(turn == 0, 1, turn)
        turn /= np.abs(turn)
        # Each two of them meet half way: both are as far off as the other.
        middle, goal = (old[i] + old[i + 1 :]) / 2, (new[i] + new[i + 1 :]) / 2
        off = np.abs(goal[:, None] + turn[:, None] * (old - middle[:, None]) - new)
        fits = off <= most_m
        sums = np.where(fits, off, 0).sum(axis=1)
        for at in np.flatnonzero(fits.sum(axis=1) >= key[0]).tolist():
            if (found := (int(fits[at].sum()), -float(sums[at]))) > key:
                best, key = fits[at], found
    return best


def _hints(old: Points, new: Points) -> list[str]:
    """Return what a fit with a mirror, or with a scale, says, where that fits much better."""
    a, b = old - _sum(old) / len(old), new - _sum(new) / len(new)
    spread = math.fsum((np.abs(a) ** 2).tolist())
    straight, mirrored = _sum(np.conj(a) * b), _sum(a * b)
    scale = abs(straight) / spread
    rigid = _off(b - a * cmath.rect(1.0, cmath.phase(straight)))
    hints = []
    flipped = _off(b - np.conj(a) * cmath.rect(1.0, cmath.phase(mirrored)))
    if len(a) > 2 and rigid > LEAST_SPOILING_M and flipped * SPOILS < rigid:
        hints.append(
            f"A mirrored map would fit much better ({flipped:.2f} m, root mean square, instead of "
            f"{rigid:.2f} m): one of the two is drawn upside down, with y down perhaps."
        )
    scaled = _off(b - a * (straight / spread))
    if abs(scale - 1) > LEAST_SCALE and len(a) > 2 and scaled * SPOILS < rigid:
        hints.append(
            f"Maps of another scale would fit much better ({scaled:.2f} m, root mean square, "
            f"instead of {rigid:.2f} m): the new one is {scale:.4g} times as large; look at the "
            "`resolution` of both."
        )
    return hints


def _off(differences: Points) -> float:
    return math.sqrt(math.fsum((np.abs(differences) ** 2).tolist()) / len(differences))
