"""The fields of doors as last-writer-wins registers: what events write to them, and who wins.

A stamp is (happened time, event number); an event that claims to have happened after it was
recorded counts from its recorded time. Of all writes to a register that with the greatest stamp
stays, in whatever order they come.
(Shapiro et al., "Conflict-free Replicated Data Types", 2011: LWW-Register.)

Also who set the states of doors and when: the writes of many events, as rows that can be sorted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.loops import compiled
from semmap_log.core.model.events import SETTING_KINDS, DoorEvent, DoorObserved, Event
from semmap_log.core.model.meaning import REGISTER_OF, REGISTERS, Presence

COMES, GOES = 254, 255
"""In place of a state: the door is added, or removed."""

STATE_ROW: np.dtype[np.void] = np.dtype(
    [("door_id", "u4"), ("folds_ns", "i8"), ("number", "i8"), ("recorded_ns", "i8"),
     ("state", "u1"), ("is_sighting", "?"), ("accuracy_open", "f8"), ("accuracy_closed", "f8"),
     ("run", "i8")]
)  # fmt: skip
"""A write to a door's state; `run` is free for whoever groups them."""


def state_rows(batches: Iterable[EventBatch]) -> NDArray[np.void]:
    """Return the writes to states, and the comings and goings of doors, as `STATE_ROW`."""
    found = [np.empty(0, STATE_ROW)]
    for batch in batches:
        for writes in writes_of(batch):
            if writes.register not in ("state", "added", "removed"):
                continue
            places = writes.positions
            rows = np.zeros(len(places), STATE_ROW)
            rows["door_id"] = batch.door_ids()[places]
            rows["folds_ns"], rows["number"] = batch.folds_ns[places], batch.number[places]
            rows["recorded_ns"] = batch.recorded_ns[places]
            told = writes.values_of(np.arange(len(places)))
            rows["state"] = told.get("state", COMES if writes.register == "added" else GOES)
            is_seen = rows["is_sighting"] = batch.kind[places] == DoorObserved.kind
            if is_seen.any():
                seen = batch[DoorObserved][
                    np.searchsorted(batch.where(DoorObserved), places[is_seen])
                ]
                for name in ("accuracy_open", "accuracy_closed"):
                    rows[name][is_seen] = seen[name]
            found.append(rows)
    return np.concatenate(found)


Array = NDArray[Any]

_PLACE_OF = {register: place for place, register in enumerate(REGISTERS)}

_BY_PRESENCE = {Presence.COMES: "added", Presence.GOES: "removed"}

NEVER = -1
"""The event number of a register that nothing has set."""

NOBODY = -1
"""The row of what is about no door: the last one, which is never a door's."""


class Writes(NamedTuple):
    """What some events of a batch write to one register."""

    register: str
    positions: NDArray[np.intp]
    """Of the events in the batch."""
    values_of: Callable[[NDArray[np.intp]], Mapping[str, Array]]
    """Returns the values of the writes at some places among these. Most are outdone by others of
    the same batch: theirs are never looked at."""


class DoorColumns(Mapping[str, Array]):
    """A row for each door, in columns: its id, its last event, and what its registers hold."""

    def __init__(self, room: int) -> None:
        """Make as many empty rows.

        Args:
            room: At least one, which is nobody's.
        """
        self.room = room
        self._happened_ns = np.full((len(REGISTERS), room), -1, np.int64)
        self._event = np.full((len(REGISTERS), room), NEVER, np.int64)
        self._scratch = np.empty(0, np.int64)
        """What a loop works with: -1 for each row, between two calls."""
        self._named: dict[str, Array] = {
            "door_id": np.zeros(room, "u4"),
            "last_event": np.full(room, NEVER, "i8"),
        }
        for register, happened_ns, event in zip(
            REGISTERS, self._happened_ns, self._event, strict=True
        ):
            for name, dtype in REGISTERS[register].items():
                self._named[name] = np.full(room, np.nan if dtype == "f8" else 0, dtype)
            self._named[f"{register}_happened_ns"] = happened_ns
            self._named[f"{register}_event"] = event

    @classmethod
    def holding(cls, columns: Mapping[str, Array], count: int, room: int) -> DoorColumns:
        """Return the first rows of other columns, and room for more.

        Args:
            columns: By the same names.
            count: How many of their rows.
            room: More than that.
        """
        made = cls(room)
        for name, column in made.items():
            column[:count] = columns[name][:count]
        return made

    def __getitem__(self, name: str) -> Array:
        return self._named[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._named)

    def __len__(self) -> int:
        return len(self._named)

    def touch(self, rows: NDArray[np.intp], numbers: NDArray[np.int64]) -> None:
        """Note, for each door, the last event about it, whatever that sets."""
        loops = compiled()
        if loops is None:
            np.maximum.at(self._named["last_event"], rows, numbers)
        else:
            loops.keep_greatest(self._named["last_event"], rows, numbers)

    def write(
        self,
        written: Sequence[Writes],
        rows: NDArray[np.intp],
        happened: NDArray[np.int64],
        numbers: NDArray[np.int64],
    ) -> None:
        """Write what is newer than what is there.

        Args:
            written: What a batch writes.
            rows: Of the doors that its events are about.
            happened: When each event happened.
            numbers: The events' numbers, ascending.
        """
        if not written:
            return
        loops = compiled()
        if loops is None:
            self._write_at_once(written, rows, happened, numbers)
            return
        if len(self._scratch) < self.room:
            self._scratch = np.full(self.room, -1, np.int64)
        for writes in written:
            place = _PLACE_OF[writes.register]
            won = np.empty(min(len(writes.positions), self.room), np.int64)
            count = loops.settle(
                writes.positions, rows, happened, numbers,
                self._happened_ns[place], self._event[place], self._scratch, won,
            )  # fmt: skip
            self._keep(writes, won[:count], rows)

    def _keep(self, writes: Writes, won: NDArray[np.intp], rows: NDArray[np.intp]) -> None:
        """Keep the values of the writes at some places among these; one at most for each row."""
        if len(won):
            mine = rows[writes.positions[won]]
            for name, values in writes.values_of(won).items():
                self._named[name][mine] = values

    def _write_at_once(
        self,
        written: Sequence[Writes],
        rows: NDArray[np.intp],
        happened: NDArray[np.int64],
        numbers: NDArray[np.int64],
    ) -> None:
        """Write by numpy, all registers at once."""
        where = np.concatenate([writes.positions for writes in written])
        ends = np.cumsum([len(writes.positions) for writes in written]).tolist()
        spans = list(zip([0, *ends[:-1]], ends, strict=True))
        registers = [_PLACE_OF[writes.register] * self.room for writes in written]
        cells = rows.take(where)
        for (start, end), register in zip(spans, registers, strict=True):
            cells[start:end] += register
        winners = self._settle(cells, happened.take(where), where, numbers)
        borders = np.searchsorted(winners, [0, *ends]).tolist()
        for writes, (start, _), (first, behind) in zip(
            written, spans, pairwise(borders), strict=True
        ):
            self._keep(writes, winners[first:behind] - start, rows)

    def write_one(self, row: int, event: DoorEvent, stamp: tuple[int, int]) -> None:
        """Write what one event sets, where that is newer; the same as `write`, for few of them."""
        self._named["last_event"][row] = max(self._named["last_event"][row], stamp[1])
        sets, values = event.sets(), event.values_set()
        registers = [register for part, register in REGISTER_OF.items() if part & sets]
        registers += [name for what, name in _BY_PRESENCE.items() if what is event.effect.presence]
        for register in registers:
            place = _PLACE_OF[register]
            if stamp > (self._happened_ns[place, row], self._event[place, row]):
                self._happened_ns[place, row], self._event[place, row] = stamp
                for name in REGISTERS[register]:
                    self._named[name][row] = values[name]

    def _settle(
        self, cells: Array, happened: Array, where: Array, numbers: Array
    ) -> NDArray[np.intp]:
        """Stamp the registers, and return which writes won, ascending; one at most for each.

        Args:
            cells: The register that each write is to, as its place among all of all doors.
            happened: When each happened.
            where: The position of the event that each is of.
            numbers: The events' numbers, ascending.
        """
        stored_ns, stored_event = self._happened_ns.ravel(), self._event.ravel()
        before = stored_ns.take(cells)
        np.maximum.at(stored_ns, cells, happened)
        latest = np.flatnonzero(happened == stored_ns.take(cells))
        latest = latest[np.argsort(where[latest], kind="stable")]
        last = np.empty(len(stored_ns), np.intp)
        last[cells[latest]] = latest  # of assignments to the same place numpy keeps the last
        winners = np.sort(latest[last[cells[latest]] == latest])
        cells, events = cells[winners], numbers[where[winners]]
        is_newer = (happened[winners] > before[winners]) | (events > stored_event[cells])
        stored_event[cells[is_newer]] = events[is_newer]
        won: NDArray[np.intp] = winners[is_newer]
        return won


def writes_of(batch: EventBatch) -> Iterator[Writes]:
    """Yield what the batch writes, register by register."""
    for kind in SETTING_KINDS:
        if kind in batch:
            yield from _writes_of_kind(batch, kind)


def _writes_of_kind(batch: EventBatch, kind: type[Event]) -> Iterator[Writes]:
    effect, where = kind.effect, batch.where(kind)
    if effect.presence in _BY_PRESENCE:
        yield Writes(_BY_PRESENCE[effect.presence], where, lambda _: {})
    among = np.flatnonzero(batch[kind][effect.only_if]) if effect.only_if else None
    changed = batch[kind]["changed"] if effect.says_what else None
    for part, register in REGISTER_OF.items():
        if not part & effect.can_set:
            continue
        places = among if changed is None else np.flatnonzero(changed & int(part) != 0)
        if places is None or len(places):
            positions = where if places is None else where[places]
            yield Writes(register, positions, _ValuesOf(register, batch, kind, places))


@dataclass(frozen=True, slots=True)
class _ValuesOf:
    """Gives what rows of a kind write to a register: those at places among all, or among some."""

    register: str
    batch: EventBatch
    kind: type[Event]
    among: NDArray[np.intp] | None

    def __call__(self, places: NDArray[np.intp]) -> Mapping[str, Array]:
        wanted, known = REGISTERS[self.register], self.kind.effect.values
        always = {
            name: np.full(len(places), known[name], wanted[name])
            for name in wanted
            if name in known
        }
        if len(always) == len(wanted):
            return always
        places = places if self.among is None else self.among[places]
        rows = self.batch.some(self.kind, places)
        return always | {name: rows[name] for name in wanted if name not in known}
