"""Which kinds of record a chunk contains, as bits: so that a question reads only what it needs.

Bit k stands for the kind of event with that number; one bit stands for all kinds of later versions,
and the others for records of the log itself.

`Page` splits the records of one or more chunks into events, commits and keyframes. One compiled
pass finds where the messages of chunks begin, and the events among them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import starmap
from pathlib import PurePath
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.columnar_events import LazyColumns, places_by_kind
from semmap_log.core.batches.event_batch import EventBatch, SourcesOf, distinct
from semmap_log.core.lazily import computed_once
from semmap_log.core.loops import compiled
from semmap_log.core.messages import decode, fixed_layout, layout, read_message, type_name
from semmap_log.core.model.commits import Commit, Durability, Note
from semmap_log.core.model.events import (
    KINDS,
    DoorObserved,
    DoorPassed,
    DoorRequested,
    DoorUpdated,
    Event,
    RobotPose,
    SightingsThinned,
    UnknownEvent,
    unknown_kind,
)
from semmap_log.errors import CorruptLogError
from semmap_log.store import byte_layout
from semmap_log.store import records as mcap
from semmap_log.store.newer import name_of
from semmap_log.store.record_scan import (
    ChunkDamage,
    ScannedChunks,
    ScannedRecords,
    gather,
    gather_after,
    heads_of,
    walk,
)


class Heads:
    """The fixed fields of many message records, as columns by the names of `HEAD_DTYPE`."""

    def __init__(self, rows: NDArray[np.void]) -> None:
        self._rows = rows
        self._columns: dict[str, NDArray[Any]] = {}

    def __getitem__(self, name: str) -> NDArray[Any]:
        column = self._columns.get(name)
        if column is None:  # packed rows cost numpy several times as much, at each use
            column = self._columns[name] = np.ascontiguousarray(self._rows[name])
        return column

    def __len__(self) -> int:
        return len(self._rows)


_NO_NOTE = Note()


def _each(blobs: NDArray[np.uint8]) -> list[bytes]:
    """Return the rows of a matrix of bytes."""
    data, size = blobs.tobytes(), blobs.shape[1]
    return [data[at : at + size] for at in range(0, len(data), size)]


@dataclass(frozen=True)
class Page:
    """Message records that follow each other in a segment, whole chunks joined."""

    records: bytes | memoryview
    first_event: int
    """Event number at which their segment begins: `sequence` has the low 32 bits only."""
    path: PurePath
    """Their file, for messages."""
    offset: int = 0
    """Where their first chunk lies in it, for messages."""
    scanned: ScannedRecords | None = None
    """Where each record begins, if they have been walked already."""

    @computed_once
    def offsets(self) -> NDArray[np.int64]:
        """Where each record begins.

        Raises:
            CorruptLogError: They are not messages, one after the other.
        """
        try:
            return walk(self.records) if self.scanned is None else self.scanned.offsets
        except ChunkDamage as damage:
            raise CorruptLogError(self.path, self.offset, str(damage)) from None

    @computed_once
    def heads(self) -> Heads:
        """The fixed fields of each record."""
        known = None if self.scanned is None else self.scanned.heads
        return Heads(heads_of(self.records, self.offsets) if known is None else known)

    @computed_once
    def bits(self) -> NDArray[np.uint32]:
        """Which kind of record each is, as a bit: `pages`."""
        return bits_of_channels(self.heads["channel_id"])

    @property
    def levels(self) -> set[int]:
        """Levels whose floor map is here."""
        channels = distinct(self.heads["channel_id"])
        return set(
            (
                channels[channels >= byte_layout.FLOOR_MAP_CHANNEL] - byte_layout.FLOOR_MAP_CHANNEL
            ).tolist()
        )

    def events(
        self,
        sources_of: SourcesOf | None = None,
        names: Mapping[int, str] = MappingProxyType({}),
        *,
        doors: Collection[int] | None = None,
    ) -> EventBatch:
        """Return its events as columns, those of unknown kinds, too.

        Args:
            sources_of: Looks up their sources on request.
            names: What a later version calls its kinds, by their numbers.
            doors: Those of fixed size that are about other doors may be left out; None: none may.

        Raises:
            CorruptLogError: A record's payload is not what its channel carries.
        """
        try:
            return self._events(sources_of, names, doors)
        except ValueError as error:
            raise CorruptLogError(self.path, self.offset, str(error)) from None

    def _events(
        self, sources_of: SourcesOf | None, names: Mapping[int, str], doors: Collection[int] | None
    ) -> EventBatch:
        fields = self.event_fields
        if doors is not None:
            is_about_others = byte_layout.ABOUT_A_DOOR.take(fields.kind) & ~np.isin(
                fields.door_id, list(doors)
            )
            fields = fields.chosen(~is_about_others)
        places = places_by_kind(fields.kind)
        fixed = {kind: mine for kind, mine in places.items() if kind in byte_layout.FIXED_KINDS}
        objects: dict[int, list[Event]] = {}
        door_ids = fields.door_id
        for kind, mine in places.items():
            if kind not in fixed:
                objects[kind] = self._objects(kind, fields.place[mine], names)
                door_ids[mine] = [getattr(event, "door_id", 0) for event in objects[kind]]
        return EventBatch(
            number=fields.number,
            kind=fields.kind,
            happened_ns=fields.happened_ns,
            recorded_ns=fields.recorded_ns,
            columns=LazyColumns(
                fixed, lambda kind, some: self._rows(kind, fields.place[fixed[kind][some]])
            ),
            objects=objects,
            known_door_ids=door_ids,
            sources_of=sources_of,
        ).with_places(places)

    @property
    def event_fields(self) -> byte_layout.EventFields:
        """The fixed fields of its events: made once, since callers may write to them.

        Raises:
            ValueError: One is not of its kind's length.
        """
        known = None if self.scanned is None else self.scanned.events
        if known is not None:
            return known
        fields = byte_layout.fields_of(self.heads, self.first_event)
        self._check_lengths(fields)
        return fields

    def commits(self) -> list[Commit]:
        """Return the commits whose Commit record is here, notes included.

        Raises:
            CorruptLogError: One is not what its channel carries.
        """
        places = self.commit_places()
        try:
            if len(places) < np.count_nonzero(
                self.heads["channel_id"] == byte_layout.COMMIT_CHANNEL
            ):
                raise ValueError("a Commit of a wrong size")  # noqa: TRY301
            return self._commits(places)
        except ValueError as error:
            raise CorruptLogError(self.path, self.offset, str(error)) from None

    def last_commit(self) -> Commit | None:
        """Return its last commit; None: it has none."""
        places = self.commit_places()
        return self._commit(int(places[-1])) if len(places) else None

    def commit_holding(self, event: int) -> Commit | None:
        """Return the first commit whose last event is that one or a later one, or None."""
        places, ends = self._commit_ends
        found = int(ends.searchsorted(event, "right"))
        return self._commit(int(places[found])) if found < len(places) else None

    @computed_once
    def _commit_ends(self) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
        """Where its Commit messages are, and the number after the last event of each."""
        places = self.commit_places()
        rows = self.commit_rows(places)
        return places, rows["first_event"].astype(np.int64) + rows["count"]

    def event_numbers(self, *, recorded_by_ns: int | None = None) -> NDArray[np.int64]:
        """Return the numbers of its events, or of those that were recorded by a time."""
        chosen = byte_layout.kinds_of(self.heads["channel_id"]) > 0
        if recorded_by_ns is not None:
            chosen &= self.heads["log_time"] <= recorded_by_ns
        return self.numbers(np.flatnonzero(chosen))

    def numbers(self, places: NDArray[np.intp]) -> NDArray[np.int64]:
        """Return the event numbers that the records at these places bear."""
        return byte_layout.numbers_of_sequence(self.heads["sequence"][places], self.first_event)

    def commit_places(self) -> NDArray[np.intp]:
        """Return the places of its Commit messages, as far as they are of the right size."""
        is_commit = self.heads["channel_id"] == byte_layout.COMMIT_CHANNEL
        size = mcap.MESSAGE_BODY_HEAD + layout("Commit").dtype.itemsize
        return np.flatnonzero(is_commit & (self.heads["length"] == size))

    def commit_rows(self, places: NDArray[np.intp]) -> NDArray[np.void]:
        """Return the Commit messages at these places as columns: the fields of Commit.msg.

        Args:
            places: Where they are among its messages: `commit_places`.
        """
        offsets = self.offsets[places] + mcap.MESSAGE.size
        return gather(self.records, offsets, layout("Commit").dtype)

    def keyframes(self) -> list[bytes]:
        """Return the CDR bytes of its Keyframe messages."""
        chosen = np.flatnonzero(self.heads["channel_id"] == byte_layout.KEYFRAME_CHANNEL).tolist()
        return [self._payload(i) for i in chosen]

    def _rows(self, kind: int, places: NDArray[np.intp]) -> NDArray[np.void]:
        return gather_after(
            self.records, self.offsets, mcap.MESSAGE.size, places, fixed_layout(kind).dtype
        )

    def _check_lengths(self, fields: byte_layout.EventFields) -> None:
        lengths = byte_layout.message_lengths().take(fields.kind)
        got = self.heads["length"].take(fields.place).view(np.int64)
        wrong = fields.kind[(lengths >= 0) & (lengths != got)]
        if len(wrong):
            fixed = fixed_layout(int(wrong[0]))
            raise ValueError(f"a {fixed.name} that is not {fixed.dtype.itemsize} bytes long")

    def record(self, i: int) -> bytes | memoryview:
        """Return a whole Message record, by its place."""
        start = int(self.offsets[i])
        return self.records[start : start + mcap.FRAME.size + int(self.heads["length"][i])]

    def _payload(self, i: int) -> bytes:
        return bytes(self.record(i)[mcap.MESSAGE.size :])

    def _objects(
        self, kind: int, places: NDArray[np.int64], names: Mapping[int, str]
    ) -> list[Event]:
        """Return the events of a kind that are at these places, which are no columns."""
        if kind <= len(KINDS):
            return [self._object(kind, i) for i in places.tolist()]
        cls = unknown_kind(kind, name_of(kind, names))
        return [self._unknown(cls, i) for i in places.tolist()]

    def _object(self, kind: int, i: int) -> Event:
        level = max(0, int(self.heads["channel_id"][i]) - byte_layout.FLOOR_MAP_CHANNEL)
        return decode(kind, self._payload(i), int(self.heads["publish_time"][i]), level)

    def _unknown(self, cls: type[UnknownEvent], i: int) -> Event:
        return cls(happened_ns=int(self.heads["publish_time"][i]), data=self._payload(i))

    def _commits(self, places: NDArray[np.intp]) -> list[Commit]:
        """Return the commits whose Commit messages are at these places: `_commit` of many."""
        rows = self.commit_rows(places)
        if len(rows) and rows["durability"].max() > max(Durability):
            raise ValueError(f"a Commit of durability {rows['durability'].max()}")
        has_note = (places > 0) & (self.heads["channel_id"][places - 1] == byte_layout.NOTE_CHANNEL)
        recorded_ns = self.heads["log_time"][places] - rows["count"] - has_note
        notes = [
            self._note(place - 1) if has else _NO_NOTE
            for place, has in zip(places.tolist(), has_note.tolist(), strict=True)
        ]
        columns = (
            rows["first_event"].tolist(), rows["count"].tolist(),
            recorded_ns.tolist(), self.heads["log_time"][places].tolist(),
            _each(rows["command_id"]), rows["wall_clock_ns"].tolist(),
            rows["monotonic_clock_ns"].tolist(), _each(rows["boot_id"]),
            _each(rows["previous_hash"]), _each(rows["hash"]),
            map(Durability, rows["durability"].tolist()), rows["durable_before"].tolist(),
            _each(rows["content"]), notes,
        )  # fmt: skip
        return list(starmap(Commit, zip(*columns, strict=True)))

    def _commit(self, i: int) -> Commit:
        at = int(self.offsets[i]) + mcap.MESSAGE.size
        fields: dict[str, Any] = layout("Commit").unpack(self.records, at)
        has_note = i > 0 and bool(self.heads["channel_id"][i - 1] == byte_layout.NOTE_CHANNEL)
        fields["durability"] = Durability(fields["durability"])
        closed_ns = int(self.heads["log_time"][i])
        return Commit(
            recorded_ns=closed_ns - fields["count"] - has_note,
            closed_ns=closed_ns,
            note=self._note(i - 1) if has_note else _NO_NOTE,
            **fields,
        )

    def _note(self, i: int) -> Note:
        said = read_message(type_name("CommitNote"), self._payload(i))
        return Note(**(said | {"salt": bytes(said["salt"])}))


def compiled_scan(
    records: bytes | memoryview,
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    *,
    first_event: int,
    expected: int,
) -> ScannedRecords | None:
    """Return what is in the records of chunks; None: there are no compiled loops, or damage.

    Damage is for `scan_together` to name.

    Args:
        records: What holds the chunks' records.
        starts: Where those of each chunk begin …
        ends: … and where they end.
        first_event: Event number at which their segment begins.
        expected: About how many messages there are; if there are more, it takes longer.
    """
    loops = compiled()
    if loops is None or not 0 <= first_event < _MOST_FIRST_EVENT:
        return None
    for room in (expected, int((ends - starts).sum()) // mcap.MESSAGE.size):
        offsets, fields = np.empty(room, np.int64), byte_layout.EventFields.room_for(room)
        chunks = ScannedChunks.room_for(len(starts))
        messages, events, has_wrong_length = loops.scan(
            records,
            starts,
            ends,
            first_event,
            *_tables(),
            offsets,
            fields.place,
            fields.number,
            fields.kind,
            fields.happened_ns,
            fields.recorded_ns,
            fields.door_id,
            *chunks,
        )
        if messages >= 0:
            found = None if has_wrong_length else fields.chosen(slice(events))
            return ScannedRecords(offsets[:messages], None, chunks, found)
        if messages == loops.DAMAGED:
            break
    return None


_MOST_FIRST_EVENT = 2**62
"""So far numbers can be counted on without a look at each."""


class _Tables(NamedTuple):
    kind_of: NDArray[np.uint8]
    bit_of: NDArray[np.uint32]
    length_of: NDArray[np.int64]
    is_about: NDArray[np.uint8]


@cache
def _tables() -> _Tables:
    is_about = byte_layout.ABOUT_A_DOOR.view(np.uint8)
    return _Tables(
        byte_layout.KIND_OF_CHANNEL, BIT_OF_CHANNEL, byte_layout.message_lengths(), is_about
    )


TOMBSTONE_BIT = 1
UNKNOWN_BIT = 1 << 27
"""Kinds of events that a later version has added."""
FOREIGN_BIT = 1 << 28
COMMIT_BIT = 1 << 29
NOTE_BIT = 1 << 30
KEYFRAME_BIT = 1 << 31
EVENT_BITS = FOREIGN_BIT - 2
"""Any kind of event, unknown ones, too."""

_CARE = {
    byte_layout.COMMIT_CHANNEL: COMMIT_BIT,
    byte_layout.NOTE_CHANNEL: NOTE_BIT,
    byte_layout.KEYFRAME_CHANNEL: KEYFRAME_BIT,
    byte_layout.TOMBSTONE_CHANNEL: TOMBSTONE_BIT,
}


def _bit_of_channel(channel: int) -> int:
    kind = byte_layout.kind_of_channel(channel)
    return _CARE.get(channel, FOREIGN_BIT) if kind is None else _bit_of_kind(kind)


def _bit_of_kind(kind: int) -> int:
    return 1 << kind if kind <= len(KINDS) else UNKNOWN_BIT


BIT_OF_CHANNEL = np.full(2**16, _bit_of_channel(byte_layout.FLOOR_MAP_CHANNEL), np.uint32)
"""The bit of each possible channel; those after the first floor map's carry floor maps, too."""
BIT_OF_CHANNEL[: byte_layout.FLOOR_MAP_CHANNEL] = [
    _bit_of_channel(channel) for channel in range(byte_layout.FLOOR_MAP_CHANNEL)
]


def bits_of_channels(channels: NDArray[np.uint16]) -> NDArray[np.uint32]:
    """Return the bit of each channel."""
    bits: NDArray[np.uint32] = BIT_OF_CHANNEL.take(channels)
    return bits


EXPIRING: tuple[type[Event], ...] = (
    DoorUpdated, DoorObserved, DoorRequested, DoorPassed, RobotPose, SightingsThinned,
)  # fmt: skip
"""What retention takes out of old segments, but for the last of each door that set its state. All
other kinds stay: which doors, levels, floor plans and rounds there were, what was retracted, and by
whom."""

_BITS_OF_KINDS = np.array([_bit_of_kind(kind) for kind in range(2**8)], np.uint32)


def bits_of_kind_numbers(kinds: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return the bit of each event, by its kind's number."""
    bits: NDArray[np.uint32] = _BITS_OF_KINDS.take(kinds)
    return bits


def bits_of_counts(counts: Mapping[int, int]) -> int:
    """Return the bits of all channels that have messages."""
    return sum({_bit_of_channel(channel) for channel, count in counts.items() if count})


def kinds_mask(kinds: Iterable[type[Event]]) -> int:
    """Return the bits of these kinds of events together."""
    return sum({_bit_of_kind(kind.kind) for kind in kinds})


EXPIRING_BITS = kinds_mask(EXPIRING)
