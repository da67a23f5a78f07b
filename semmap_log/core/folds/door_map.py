"""The door database as a fold: every field of a door keeps the value with the greatest stamp.

Since each field is a last-writer-wins register, the fold commutes: late events, batches of any size
and a keyframe plus its tail all give the same state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, in_ranges
from semmap_log.core.folds.levels import Annotations, DoorsPresent, Stamp
from semmap_log.core.folds.registers import NEVER, NOBODY, DoorColumns, writes_of
from semmap_log.core.model import doors as door_model
from semmap_log.core.model import events
from semmap_log.core.model.meaning import FIELDS, REGISTERS, Presence

Array = NDArray[Any]

STATE_VERSION = 2
"""Of the arrays that `to_arrays` gives; another version's keyframes are not used."""

MAX_TABLE = 2**20
"""Doors with greater ids (8 MiB of table) are looked up one by one."""
UNKNOWN_ROW = -2

_OF_A_DOOR = (
    "door_id", *FIELDS, "state_happened_ns", "last_event", "added_happened_ns", "added_event",
)  # fmt: skip
"""The columns of which a `Door` is made."""


class DoorMapState:
    """The state of the fold: a column for each value and each stamp, a row for each door.

    Doors that were removed keep their row: their stamps must still beat late events.
    """

    def __init__(self) -> None:
        self.event = -1
        """The greatest event number folded in."""
        self.latest: Stamp = (0, NEVER)
        """Of all events folded in, the last by which they are ordered: (happened, number)."""
        self.used_door_ids: set[int] = set()
        self._row_of: dict[int, int] = {}
        self._row_by_id = np.empty(0, np.intp)
        """The same for ids below `MAX_TABLE`, to look up many at once."""
        self._columns = DoorColumns(room=1)
        self._annotations = Annotations()
        self._levels: dict[int, tuple[Stamp, str, float]] = {}
        self._floor_maps: dict[int, Stamp] = {}

    def apply(self, batch: EventBatch) -> None:
        """Fold a batch in."""
        if not len(batch):
            return
        self.event = max(self.event, int(batch.number[-1]))
        happened = batch.folds_ns
        self.latest = max(self.latest, _last_stamp(happened, batch.number))
        self.note_used_ids(batch)
        rows = self._rows(batch)
        self._columns.touch(rows, batch.number)
        self._columns.write(list(writes_of(batch)), rows, happened, batch.number)
        self._apply_objects(batch, happened)

    def apply_one(self, event: events.Event, number: int) -> None:
        """Fold one event in: the same as a batch of one, for who has them one by one.

        Args:
            event: With the time by which it is ordered.
            number: Its number.
        """
        assert event.happened_ns is not None
        stamp = (event.happened_ns, number)
        self.event, self.latest = max(self.event, number), max(self.latest, stamp)
        if isinstance(event, events.DoorEvent):
            row = self._row(event.door_id)  # may make new columns
            self._columns.write_one(row, event, stamp)
        if event.effect.presence is Presence.COMES and isinstance(event, events.DoorEvent):
            self.used_door_ids.add(event.door_id)
        self._apply_object(event, stamp)

    def note_used_ids(self, batch: EventBatch) -> None:
        """Remember the ids that the batch gives away; retracted events count here, too."""
        for kind in events.ADDING_KINDS:
            if kind in batch:
                self.used_door_ids.update(batch[kind]["door_id"].tolist())

    @property
    def latest_happened_ns(self) -> int:
        """The latest happened time of all events folded in; 0 if there are none."""
        return self.latest[0]

    def first_among(self, ranges: Sequence[tuple[int, int]]) -> int | None:
        """Return the first of these events without which the map would differ, or None.

        A register that another event has written since is the same whether they came or not.

        Args:
            ranges: First and last event number of each.
        """
        if not ranges:
            return None
        numbers = self._winners()
        return min(numbers[in_ranges(numbers, ranges)].tolist(), default=None)

    def _winners(self) -> NDArray[np.int64]:
        """Return the numbers of the events whose values it holds."""
        n = len(self._row_of)
        columns = [self._columns[f"{register}_event"][:n] for register in REGISTERS]
        levels = [stamp[1] for stamp, _, _ in self._levels.values()]
        drawn = [stamp[1] for stamp in self._floor_maps.values()]
        others = [self.event, self.latest[1], *self._annotations.events(), *levels, *drawn]
        return np.concatenate([self._columns["last_event"][:n], *columns, others]).astype(np.int64)

    def is_present(self, door_id: int) -> bool:
        """Return whether the door is in the map."""
        row = self._row_of.get(door_id)
        if row is None:
            return False
        return bool(self._is_here(slice(row, row + 1))[0])

    def _is_here(self, rows: slice) -> NDArray[np.bool_]:
        """Return which doors are in the map: added, and not removed since.

        A removal that comes before the adding concerned no door: it leaves the map unchanged.
        """
        names = ("added_happened_ns", "added_event", "removed_happened_ns", "removed_event")
        added_ns, added, removed_ns, removed = (self._columns[name][rows] for name in names)
        is_later = (removed_ns > added_ns) | ((removed_ns == added_ns) & (removed > added))
        here: NDArray[np.bool_] = (added >= 0) & ~((removed >= 0) & is_later)
        return here

    def last_event(self, door_id: int) -> int:
        """Return the number of the last event about a door; -1 if there is none."""
        row = self._row_of.get(door_id)
        return NEVER if row is None else int(self._columns["last_event"][row])

    def is_placed(self, door_id: int) -> bool:
        """Return whether the door has a place on the floor."""
        row = self._row_of.get(door_id)
        return row is not None and not np.isnan(self._columns["x"][row])

    def level_of(self, door_id: int) -> int:
        """Return the level that a door was put on last; 0 for one that nobody knows."""
        row = self._row_of.get(door_id)
        return 0 if row is None else int(self._columns["level"][row])

    def level_names(self) -> dict[int, str | None]:
        """Return the levels that have a name or a floor map, numbers ascending, with the names."""
        return {number: level.name for number, level in self._level_map().items()}

    def classes(self) -> dict[str, door_model.ObjectClass]:
        """Return the classes of objects that are defined, names ascending."""
        return self._annotations.classes()

    def objects(self) -> dict[door_model.DoorId, door_model.ObjectClass]:
        """Return what all objects are that are no doors, removed ones too; ids ascending."""
        classes = self.classes()
        said = self.since_added(door_model.CLASS) if classes else {}
        return {i: classes[name] for i, name in said.items() if name in classes}

    def since_added(self, key: str) -> dict[door_model.DoorId, str]:
        """Return each door's text under a key, set since it was added; ids ascending."""
        said = self._annotations.texts_under(key)
        return {i: text for i, (stamp, text) in said.items()
                if (added := self.stamp(i, "added")) is not None and stamp > added}  # fmt: skip

    def defined(self, name: str) -> Stamp | None:
        """Return (happened, number) of the definition of a class, or None."""
        return self._annotations.defined(name)

    def names(self) -> dict[door_model.DoorId, str]:
        """Return the latest name of every door that has one, removed doors too."""
        return self._annotations.names()

    def stamp(self, door_id: int, register: str) -> Stamp | None:
        """Return (happened, number) of what a register of a door holds; None: never set."""
        row = self._row_of.get(door_id)
        if row is None or self._columns[f"{register}_event"][row] == NEVER:
            return None
        columns = self._columns
        happened = int(columns[f"{register}_happened_ns"][row])
        return happened, int(columns[f"{register}_event"][row])

    def register_of(
        self, door_ids: Array, register: str
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], dict[str, Array]]:
        """Return what a register of some doors holds: happened times, event numbers, values.

        The number is `NEVER` for a door of which it was never set.
        """
        names = (f"{register}_happened_ns", f"{register}_event", *REGISTERS[register])
        empty = DoorColumns(room=1)
        rows = np.array([self._row_of.get(door_id, -1) for door_id in door_ids.tolist()], np.intp)
        columns = [np.append(self._columns[name], empty[name])[rows] for name in names]
        happened, numbers, *values = columns
        return happened, numbers, dict(zip(REGISTERS[register], values, strict=True))

    def text(self, door_id: int, key: str) -> tuple[Stamp, str] | None:
        """Return what a door's annotation says, and since when; None: it was never made."""
        return self._annotations.get(door_id, key)

    def forget_text(self, door_id: int, key: str, before: int) -> None:
        """Drop texts that events below a number set for a door under a key: they are redacted."""
        self._annotations.forget(door_id, key, before)

    def door_map(
        self, *, at_ns: int | None = None, known_at_ns: int | None = None
    ) -> door_model.DoorMap:
        """Return the doors that are in the map, as values; the moments are only written on it."""
        n = len(self._row_of)
        columns = self._columns
        here = np.flatnonzero(self._is_here(slice(n)))
        here = here[np.argsort(columns["door_id"][here])]
        chosen = {name: columns[name][here] for name in _OF_A_DOOR}
        doors = DoorsPresent(chosen, self._annotations.snapshot())
        return door_model.DoorMap(
            doors=doors,
            levels=MappingProxyType(self._level_map()),
            classes=MappingProxyType(doors.classes),
            event=self.event,
            latest_ns=self.latest_happened_ns,
            at_ns=at_ns,
            known_at_ns=known_at_ns,
        )

    def door(self, door_id: int) -> door_model.Door | None:
        """Return one door as a value; None: it is not in the map."""
        return self._door(door_id) if self.is_present(door_id) else None

    def removed_door(self, door_id: int) -> door_model.RemovedDoor | None:
        """Return a door that was removed; None: it was not, or never was in the map."""
        removed = self.stamp(door_id, "removed")
        if removed is None or self.stamp(door_id, "added") is None or self.is_present(door_id):
            return None
        return door_model.RemovedDoor(self._door(door_id), removed[1])

    def _door(self, door_id: int) -> door_model.Door:
        row = self._row_of[door_id]
        chosen = {name: self._columns[name][row : row + 1] for name in _OF_A_DOOR}
        return DoorsPresent(chosen, self._annotations)[door_model.DoorId(door_id)]

    def to_arrays(self) -> dict[str, Any]:
        """Return the whole state as arrays and lists, the same for equal states; doors ascend."""
        n = len(self._row_of)
        order = np.argsort(self._columns["door_id"][:n])
        arrays: dict[str, Any] = {
            name: np.ascontiguousarray(column[:n][order]) for name, column in self._columns.items()
        }
        arrays["event"] = self.event
        arrays["latest_happened_ns"], arrays["latest_happened_event"] = self.latest
        arrays["used_door_ids"] = np.array(sorted(self.used_door_ids), np.uint32)
        arrays |= self._annotations.to_arrays()
        numbers = sorted(self._levels.keys() | self._floor_maps.keys())
        nameless = ((0, NEVER), "", np.nan)
        named = [self._levels.get(number, nameless) for number in numbers]
        drawn = [self._floor_maps.get(number, (0, NEVER)) for number in numbers]
        arrays["level_number"] = numbers
        arrays["level_name"] = [name for _, name, _ in named]
        arrays["level_elevation"] = [elevation for _, _, elevation in named]
        arrays["level_happened_ns"] = [stamp[0] for stamp, _, _ in named]
        arrays["level_event"] = [stamp[1] for stamp, _, _ in named]
        arrays["floor_map_happened_ns"] = [stamp[0] for stamp in drawn]
        arrays["floor_map_event"] = [stamp[1] for stamp in drawn]
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> DoorMapState:
        """Return the state that `to_arrays` saved.

        Raises:
            ValueError: Some arrays have different lengths.
        """
        state = cls()
        state.event = int(arrays["event"])
        state.latest = (int(arrays["latest_happened_ns"]), int(arrays["latest_happened_event"]))
        state.used_door_ids = set(np.asarray(arrays["used_door_ids"]).tolist())
        if len({len(arrays[name]) for name in state._columns}) > 1:
            raise ValueError("columns of different lengths")
        door_ids = np.asarray(arrays["door_id"])
        state._columns = DoorColumns.holding(arrays, len(door_ids), len(door_ids) + 1)
        state._row_of = dict(zip(door_ids.tolist(), range(len(door_ids)), strict=True))
        if len(door_ids) and door_ids[-1] < MAX_TABLE:  # they ascend
            state._grow_table(int(door_ids[-1]) + 1)
            state._row_by_id[door_ids] = np.arange(len(door_ids))
            state._row_by_id[0] = NOBODY
        state._annotations = Annotations.from_arrays(arrays)
        for i, number in enumerate(np.asarray(arrays["level_number"]).tolist()):
            if arrays["level_event"][i] != NEVER:
                stamp = (int(arrays["level_happened_ns"][i]), int(arrays["level_event"][i]))
                state._levels[number] = (
                    stamp,
                    str(arrays["level_name"][i]),
                    float(arrays["level_elevation"][i]),
                )
            if arrays["floor_map_event"][i] != NEVER:
                state._floor_maps[number] = (
                    int(arrays["floor_map_happened_ns"][i]),
                    int(arrays["floor_map_event"][i]),
                )
        return state

    def _level_map(self) -> dict[int, door_model.Level]:
        levels = {}
        for number in sorted(self._levels.keys() | self._floor_maps.keys()):
            _, name, elevation = self._levels.get(number, (None, None, np.nan))
            drawn = self._floor_maps.get(number)
            levels[number] = door_model.Level(
                number, name or None, elevation, drawn[1] if drawn else None
            )
        return levels

    def _rows(self, batch: EventBatch) -> NDArray[np.intp]:
        """Return the row of the door of each event, making new ones where needed; -1: of none."""
        rows = self._rows_but_0(batch.door_ids())
        about_0 = batch.of_door_0()
        if len(about_0):
            rows[about_0] = self._row(0)
        return rows

    def _rows_but_0(self, door_ids: Array) -> NDArray[np.intp]:
        """Return the row of each door; -1 for the id 0, which mostly stands for none."""
        if int(door_ids.max()) < len(self._row_by_id):
            rows = self._row_by_id.take(door_ids)
            if rows.min() != UNKNOWN_ROW:
                return rows
        unique, inverse = np.unique(door_ids, return_inverse=True)
        rows = np.array([self._row(i) if i else NOBODY for i in unique.tolist()], np.intp)
        if unique[-1] < MAX_TABLE:
            self._grow_table(int(unique[-1]) + 1)
            self._row_by_id[unique] = rows
        return rows[inverse]

    def _row(self, door_id: int) -> int:
        row = self._row_of.get(door_id)
        if row is None:
            row = self._row_of[door_id] = len(self._row_of)
            if row + 1 == self._columns.room:  # doubles, so that adding doors stays linear
                self._columns = DoorColumns.holding(self._columns, row, 16 + 2 * row)
            self._columns["door_id"][row] = door_id
        return row

    def _grow_table(self, size: int) -> None:
        have = len(self._row_by_id)
        if size > have:
            more = np.full(max(size, 2 * have) - have, UNKNOWN_ROW, np.intp)
            if not have:
                more[0] = NOBODY
            self._row_by_id = np.concatenate([self._row_by_id, more])

    def _apply_objects(self, batch: EventBatch, happened: Array) -> None:
        for kind in (events.DoorAnnotated, events.LevelAdded, events.FloorMap, events.ClassDefined):
            if kind not in batch:
                continue
            positions = batch.where(kind)
            stamps = zip(
                happened[positions].tolist(), batch.number[positions].tolist(), strict=True
            )
            for event, stamp in zip(batch.objects[kind.kind], stamps, strict=True):
                self._apply_object(event, stamp)

    def _apply_object(self, event: events.Event, stamp: Stamp) -> None:
        if isinstance(event, events.DoorAnnotated):
            self._annotations.write(event.door_id, event.key, event.value, stamp)
        elif isinstance(event, events.LevelAdded):
            if event.level not in self._levels or stamp > self._levels[event.level][0]:
                self._levels[event.level] = (stamp, event.name, event.elevation)
        elif isinstance(event, events.ClassDefined):
            self._annotations.define(event, stamp)
        elif isinstance(event, events.FloorMap):
            drawn = self._floor_maps.get(event.level)
            if drawn is None or stamp > drawn:
                self._floor_maps[event.level] = stamp


def _last_stamp(happened: Array, numbers: Array) -> Stamp:
    """Return the greatest (happened, number); the numbers ascend."""
    last = len(happened) - 1 - int(happened[::-1].argmax())
    return int(happened[last]), int(numbers[last])
