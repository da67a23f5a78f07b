"""What events do to doors, as rows: the one form in which all follow doors over time.

Pure numpy. A caller that needs less than all of `CHANGE` requests some of its columns: `columns`.
Also what doors and levels were called at the time of an event, by all that is known now; and
registers over time: what each of many keys held at a stamp, for many keys at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, distinct
from semmap_log.core.folds.levels import NAME
from semmap_log.core.model.doors import NO_LEVEL, DoorState
from semmap_log.core.model.events import (
    ADDING_KINDS,
    DOOR_KINDS,
    KINDS,
    SETTING_KINDS,
    DoorAnnotated,
    Event,
    FloorMap,
    LevelAdded,
    field_names,
)
from semmap_log.core.model.meaning import ALL_CHANGED, FIELDS, Changed, Presence

Changes = NDArray[Any]
"""Rows of `CHANGE`, or of some of its columns."""

Stamp = tuple[int, int]
"""(folds_ns, number): the order in which events count."""

CHANGE = np.dtype([
    ("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"),
    ("kind", "u1"), ("sets", "u1"), ("door_id", "u4"), *FIELDS.items(),
])  # fmt: skip
"""An event about a door: its number, the time by which it is ordered, when it was recorded (both
nanoseconds since 1970, UTC), its kind, and the fields of the door after it. `sets` are the bits of
`Changed` and `THERE`; the fields outside them mean nothing."""

THERE = 128
"""In `sets`, next to the bits of `Changed`: it brings the door into the map, or takes it out."""
EVERYTHING = int(ALL_CHANGED) | THERE
STATE = int(Changed.STATE)


def columns(*names: str) -> np.dtype[Any]:
    """Return a type with these columns of `CHANGE`."""
    return np.dtype([(name, CHANGE[name]) for name in names])


STATE_CHANGE = columns("door_id", "folds_ns", "number", "kind", "state")
"""What an event says of a door's state: 22 bytes."""


def door_changes(batch: EventBatch) -> Changes:
    """Return the events of the batch that can change a door, in the order of their numbers."""
    changes = np.concatenate([np.empty(0, CHANGE), *parts_of(batch)])
    return changes[np.argsort(changes["number"], kind="stable")]


def parts_of(
    batch: EventBatch,
    dtype: np.dtype[Any] = CHANGE,
    *,
    setting: int | None = None,
    doors: NDArray[np.integer[Any]] | None = None,
) -> Iterator[Changes]:
    """Yield the events of a batch that can change a door, kind by kind.

    Args:
        batch: Any events.
        dtype: `CHANGE`, or some of its columns.
        setting: Only those that set one of these bits of `sets`; None: also those that set nothing,
            such as a failed passage.
        doors: Only what is about these; None: all.
    """
    for kind in SETTING_KINDS:
        if kind in batch and (setting is None or _can_set(kind) & setting):
            places = chosen_of(batch, kind, setting=setting, doors=doors)
            yield rows_at(batch, kind, places, dtype)


def chosen_of(
    batch: EventBatch,
    kind: type[Event],
    *,
    setting: int | None = None,
    doors: NDArray[np.integer[Any]] | None = None,
) -> NDArray[np.intp]:
    """Return the places, among a kind's rows, of those that `parts_of` would yield."""
    rows = batch[kind]
    chosen = np.ones(len(rows), np.bool_)
    if setting is not None:
        chosen = (_bits_of(kind, rows) & setting) != 0
    if doors is not None:
        chosen &= np.isin(rows["door_id"], doors)
    return np.flatnonzero(chosen)


def rows_at(
    batch: EventBatch, kind: type[Event], places: NDArray[np.intp], dtype: np.dtype[Any]
) -> Changes:
    """Return a kind's rows at some places as rows of `CHANGE`, or of some of its columns."""
    changes = np.empty(len(places), dtype)
    fill(changes, batch, kind, places)
    return changes


def fill(changes: Changes, batch: EventBatch, kind: type[Event], places: NDArray[np.intp]) -> None:
    """Write a kind's rows at some places into as many rows; what they do not say becomes 0."""
    rows, where = batch[kind], batch.where(kind)[places]
    for name in changes.dtype.names or ():
        if name in _OF_EVENT:
            changes[name] = _OF_EVENT[name](batch)[where]
        elif name in kind.effect.values:
            changes[name] = kind.effect.values[name]
        elif name in (rows.dtype.names or ()):
            changes[name] = rows[name][places]
        else:
            changes[name] = _bits_of(kind, rows)[places] if name == "sets" else 0


_OF_EVENT: Mapping[str, Callable[[EventBatch], NDArray[Any]]] = {
    "number": lambda batch: batch.number,
    "folds_ns": lambda batch: batch.folds_ns,
    "recorded_ns": lambda batch: batch.recorded_ns,
    "kind": lambda batch: batch.kind,
}
"""Columns of every event, whatever it is about."""


def known_states(states: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return numbers of states; those that only a later version knows are UNKNOWN."""
    return np.where(states < len(DoorState), states, np.uint8(DoorState.UNKNOWN))


def of_presence(changes: Changes, presence: Presence) -> NDArray[np.bool_]:
    """Return which rows bring a door into the map, take it out, or do neither."""
    found: NDArray[np.bool_] = _PRESENCE[changes["kind"]] == presence.value
    return found


def are_sightings(changes: Changes) -> NDArray[np.bool_]:
    """Return which rows are sightings: see `Effect.is_sighting`."""
    found: NDArray[np.bool_] = _IS_SIGHTING[changes["kind"]]
    return found


def is_before(changes: Changes, stamp: Stamp) -> NDArray[np.bool_]:
    """Return which rows come before a stamp: (folds_ns, number)."""
    folds_ns, number = stamp
    ties = (changes["folds_ns"] == folds_ns) & (changes["number"] < number)
    earlier: NDArray[np.bool_] = (changes["folds_ns"] < folds_ns) | ties
    return earlier


def _can_set(kind: type[Event]) -> int:
    effect = kind.effect
    return int(effect.can_set) | (0 if effect.presence is Presence.STAYS else THERE)


def _bits_of(kind: type[Event], rows: NDArray[np.void]) -> NDArray[np.uint8]:
    """Return the bits that each event sets."""
    effect = kind.effect
    if effect.says_what:
        bits: NDArray[np.uint8] = rows["changed"]
        return bits
    bits = np.full(len(rows), _can_set(kind), np.uint8)
    return np.where(rows[effect.only_if], bits, np.uint8(0)) if effect.only_if else bits


_PRESENCE = np.full(256, Presence.STAYS.value, np.uint8)
_IS_SIGHTING = np.zeros(256, np.bool_)
for _kind in SETTING_KINDS:
    _PRESENCE[_kind.kind] = _kind.effect.presence.value
    _IS_SIGHTING[_kind.kind] = _kind.effect.is_sighting


Texts = tuple[NDArray[np.intp], Sequence[str]]
"""For each event, the index of its text in a list; an empty text: it has none."""

NOTHING = ""
_NEVER = (0, -1)
"""Comes before every stamp."""
_LEVEL_CHANGE = columns("door_id", "folds_ns", "number", "level")
_NAMING_KINDS = (DoorAnnotated.kind, LevelAdded.kind)
_ON_A_LEVEL = [kind.kind for kind in KINDS
               if kind.kind not in DOOR_KINDS and "level" in field_names(kind)]  # fmt: skip
"""Kinds that are about no door, and say on which level they happened."""


class NamesAsOf:
    """Takes events that set names and levels, in any order; then gives those of other events.

    A door's name is the last one set, since the door was added, by the time the event happened,
    including by events of the same moment: as in a replay of that moment. A removed door keeps its
    last name. A level without a name is called by its number.
    """

    def __init__(self) -> None:
        self._added: dict[int, Stamp] = {}
        self._said: list[tuple[int, Stamp, str]] = []
        self._moves = [np.empty(0, _LEVEL_CHANGE)]
        self._called: list[tuple[int, Stamp, str]] = []
        self._doors: _Called | None = None
        self._levels: _Called | None = None
        self._moved: LastWritten | None = None
        """Door -> its level; all three are made at the first query; nothing is added after that."""

    def apply(self, batch: EventBatch) -> None:
        """Take in events, retracted ones left out."""
        folds_ns = batch.folds_ns.tolist()
        for kind in (kind for kind in ADDING_KINDS if kind in batch):
            for door_id, at in zip(
                batch[kind]["door_id"].tolist(), batch.where(kind).tolist(), strict=True
            ):
                self._added[door_id] = (folds_ns[at], int(batch.number[at]))
        self._moves += parts_of(batch, _LEVEL_CHANGE, setting=int(Changed.POSE))
        for told in _NAMING_KINDS:
            for event, at in zip(
                batch.objects.get(told, ()), batch.places_of(told).tolist(), strict=True
            ):
                stamp = (folds_ns[at], int(batch.number[at]))
                if isinstance(event, LevelAdded):
                    self._called.append((event.level, stamp, event.name))
                elif isinstance(event, DoorAnnotated) and event.key == NAME:
                    self._said.append((event.door_id, stamp, event.value))

    def door_names(self, batch: EventBatch) -> Texts:
        """Return what the door of each event was called then."""
        if self._doors is None:
            self._doors = _Called(
                each for each in self._said if each[1] > self._added.get(each[0], _NEVER)
            )
        codes = self._doors.codes.at(batch.door_ids(), batch.folds_ns, _of_that_moment(batch))
        if 0 in self._doors.codes:  # else what is about no door has the name of none
            codes[~batch.about_doors()] = 0
        return codes, self._doors.texts

    def level_names(self, batch: EventBatch) -> Texts:
        """Return what the level was called on which each event's door, robot or map was then."""
        if self._levels is None:
            self._moved = self._levels_of_doors()
            self._levels = _Called(
                [
                    *((level, _NEVER, str(level)) for level in sorted({0, *self._moved.values()})),
                    *((level, stamp, name or str(level)) for level, stamp, name in self._called),
                ]
            )
        levels = self._levels_of(batch)
        codes = self._levels.codes.at(levels, batch.folds_ns, _of_that_moment(batch))
        nameless = np.flatnonzero((codes == 0) & (levels != NO_LEVEL))
        if not len(nameless):
            return codes, self._levels.texts
        numbers, places = np.unique(levels[nameless], return_inverse=True)
        codes[nameless] = len(self._levels.texts) + places
        return codes, [*self._levels.texts, *map(str, numbers.tolist())]

    def _levels_of(self, batch: EventBatch) -> NDArray[np.int64]:
        """Return on which level each event's door, robot or map was; `NO_LEVEL`: on none."""
        assert self._moved is not None
        levels = self._moved.at(batch.door_ids(), batch.folds_ns, batch.number)
        if 0 in self._moved:
            levels[~batch.about_doors()] = NO_LEVEL
        for kind in _ON_A_LEVEL:
            if kind in batch.columns:
                levels[batch.places_of(kind)] = batch.columns[kind]["level"]
            elif kind in batch.objects:
                told = [getattr(event, "level", NO_LEVEL) for event in batch.objects[kind]]
                levels[batch.places_of(kind)] = told
        return levels

    def _levels_of_doors(self) -> LastWritten:
        moves = np.concatenate(self._moves)
        added = np.array([self._added.get(d, _NEVER) for d in moves["door_id"].tolist()], np.int64)
        ns, number = added.reshape(-1, 2).T
        happened, number_of = moves["folds_ns"], moves["number"]
        moves = moves[(happened > ns) | ((happened == ns) & (number_of >= number))]
        return LastWritten(
            *(moves[name].astype(np.int64) for name in ("door_id", "folds_ns", "number", "level")),
            nothing=NO_LEVEL,
        )


def _of_that_moment(batch: EventBatch) -> NDArray[np.int64]:
    """Return the greatest number for each event: all events of its moment count."""
    return np.full(len(batch), np.iinfo(np.int64).max)


def affected_levels(batch: EventBatch) -> set[int]:
    """Return the levels that events name, draw, or put new doors on."""
    found: set[int] = set()
    for kind in (kind for kind in ADDING_KINDS if kind in batch):
        found.update(batch[kind]["level"].tolist())
    for told in (LevelAdded.kind, FloorMap.kind):
        events = batch.objects.get(told, ())
        found.update(e.level for e in events if isinstance(e, LevelAdded | FloorMap))
    return found


class _Called:
    """Texts by key and stamp; an empty one says nothing."""

    def __init__(self, said: Iterable[tuple[int, Stamp, str]]) -> None:
        known = {NOTHING: 0}
        rows = [(key, *stamp, known.setdefault(text, len(known))) for key, stamp, text in said]
        keys, ns, numbers, codes = np.array(rows, np.int64).reshape(-1, 4).T
        self.codes = LastWritten(keys, ns, numbers, codes, nothing=0)
        self.texts = list(known)


Integers = NDArray[np.integer[Any]]

MAX_TABLE = 2**20
"""Keys below are looked up in a table; greater ones are searched for."""


class LastWritten:
    """Values by key and stamp, (happened, number); the one with the greatest stamp counts."""

    def __init__(
        self,
        keys: Integers,
        happened_ns: NDArray[np.int64],
        numbers: NDArray[np.int64],
        values: NDArray[np.int64],
        *,
        nothing: int,
    ) -> None:
        """Take all that was ever written, in any order.

        Args:
            keys: What each was written to.
            happened_ns: When it happened.
            numbers: Of its event.
            values: What was written.
            nothing: What a key holds before anything was.
        """
        order = np.lexsort((numbers, happened_ns, keys))
        keys, values = keys[order], values[order]
        is_first = np.diff(keys, prepend=-1) != 0
        before = np.where(is_first, nothing, np.roll(values, 1))
        changes = np.flatnonzero(values != before)
        self._happened_ns = happened_ns[order][changes]
        self._numbers = numbers[order][changes]
        self._values = np.append(values[changes], nothing)
        """The last is that of whoever has none before it, by the place -1."""
        self._keys, self._starts = np.unique(keys[changes], return_index=True)
        self._ends = np.append(self._starts[1:], len(changes))
        self._starts, self._ends = np.append(self._starts, 0), np.append(self._ends, 0)
        """Of each key, and last of a key that is none of them."""
        self._last_ns = np.append(self._happened_ns, -1)[self._ends - 1]
        self._final = np.where(self._ends > self._starts, self._values[self._ends - 1], nothing)
        self._latest_ns = self._last_ns.max()
        self._table = self._table_of_keys()

    def __contains__(self, key: int) -> bool:
        """Return whether a key ever held something."""
        return key in self._keys

    def values(self) -> list[int]:
        """Return what was ever held, each value once."""
        found: list[int] = distinct(self._values[:-1]).tolist()
        return found

    def at(
        self, keys: Integers, happened_ns: NDArray[np.int64], numbers: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return what keys held right after events of these stamps."""
        rows = self._rows(keys)
        found: NDArray[np.int64] = self._final.take(rows)
        if not len(keys) or happened_ns.min() > self._latest_ns:  # as nearly always
            return found
        early = np.flatnonzero(happened_ns <= self._last_ns.take(rows))
        if len(early):
            found[early] = self._values[
                self._beyond(rows[early], happened_ns[early], numbers[early]) - 1
            ]
        return found

    def _beyond(
        self, rows: NDArray[np.intp], happened_ns: NDArray[np.int64], numbers: NDArray[np.int64]
    ) -> NDArray[np.intp]:
        """Return the place after the last change up to each stamp; 0: its key has none so early.

        All are bisected at once, as often as the key with the most changes needs.
        """
        low, high = self._starts[rows], self._ends[rows]
        first = low.copy()
        while (is_open := low < high).any():
            middle = np.where(is_open, (low + high) // 2, 0)
            ns = self._happened_ns[middle]
            is_not_later = (ns < happened_ns) | (
                (ns == happened_ns) & (self._numbers[middle] <= numbers)
            )
            low = np.where(is_open & is_not_later, middle + 1, low)
            high = np.where(is_open & ~is_not_later, middle, high)
        return np.where(low > first, low, 0)

    def _rows(self, keys: Integers) -> NDArray[np.intp]:
        """Return the place of each key among those that have changes; past the end: it has none."""
        if self._table is not None:
            return self._table.take(keys, mode="clip")
        rows = np.searchsorted(self._keys, keys)
        is_known = np.append(self._keys, -1)[rows] == keys
        return np.where(is_known, rows, len(self._keys))

    def _table_of_keys(self) -> NDArray[np.intp] | None:
        if len(self._keys) and self._keys[-1] >= MAX_TABLE:
            return None
        size = int(self._keys[-1]) + 2 if len(self._keys) else 1
        table = np.full(size, len(self._keys), np.intp)  # greater keys are clipped to the last
        table[self._keys] = np.arange(len(self._keys))
        return table
