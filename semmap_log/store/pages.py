"""Records of one or more chunks, taken apart into events, commits and keyframes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import starmap
from pathlib import PurePath
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.batches.event_batch import EventBatch, SourcesOf
from semmap_log.batches.event_columns import LazyColumns
from semmap_log.common.distinct import distinct
from semmap_log.common.lazily import computed_once
from semmap_log.domain.commits import Commit, Durability, Note
from semmap_log.domain.events import DOOR_KINDS, KINDS, Event, FloorMap, UnknownEvent, unknown_kind
from semmap_log.errors import CorruptLogError
from semmap_log.messages import (
    OBJECT_KINDS,
    decode,
    fixed_layout,
    layout,
    read_message,
    type_name,
)
from semmap_log.store import records as mcap
from semmap_log.store.form import (
    COMMIT_CHANNEL,
    FLOOR_MAP_CHANNEL,
    KEYFRAME_CHANNEL,
    NOTE_CHANNEL,
    kind_of_channel,
)
from semmap_log.store.kind_bits import UNKNOWN_BIT, bits_of_channels, kinds_of_bits
from semmap_log.store.newer import name_of
from semmap_log.store.record_scan import ChunkDamage, ScannedRecords, gather, heads_of, walk

_KIND_OF_CHANNEL = np.full(2**16, FloorMap.kind, np.uint8)
"""Of each channel there can be; those behind the first floor map's carry floor maps, too."""
_KIND_OF_CHANNEL[:FLOOR_MAP_CHANNEL] = [
    kind_of_channel(channel) or 0 for channel in range(FLOOR_MAP_CHANNEL)
]


def kinds_of(channels: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return the kind of event on each channel; 0: Commit, CommitNote, Keyframe or foreign."""
    kinds: NDArray[np.uint8] = _KIND_OF_CHANNEL.take(channels)
    return kinds


_ABOUT_A_DOOR = np.zeros(2**8, np.bool_)
"""Of each kind: whether its events begin with the door that they are about."""
_ABOUT_A_DOOR[list(DOOR_KINDS - OBJECT_KINDS)] = True


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
    """Where each record begins, where somebody has walked them already."""

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
        """Which kind of record each is, as a bit: `kind_bits`."""
        return bits_of_channels(self.heads["channel_id"])

    @property
    def levels(self) -> set[int]:
        """Levels whose floor map is here."""
        channels = distinct(self.heads["channel_id"])
        return set((channels[channels >= FLOOR_MAP_CHANNEL] - FLOOR_MAP_CHANNEL).tolist())

    def events(
        self,
        sources_of: SourcesOf | None = None,
        names: Mapping[int, str] = MappingProxyType({}),
        *,
        doors: Collection[int] | None = None,
    ) -> EventBatch:
        """Return its events as columns, those of unknown kinds, too.

        Args:
            sources_of: Looks up their sources, should somebody ask.
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
        kinds = kinds_of(self.heads["channel_id"])
        bits = int(np.bitwise_or.reduce(self.bits))
        self._check_lengths(kinds, kinds_of_bits(bits))
        is_wanted = kinds != 0
        if doors is not None:
            is_wanted &= ~_ABOUT_A_DOOR.take(kinds) | np.isin(self.heads["door_id"], list(doors))
            bits = int(np.bitwise_or.reduce(self.bits[is_wanted], initial=0))
        there = kinds_of_bits(bits)
        chosen = np.flatnonzero(is_wanted)
        sequence, happened, recorded, door_ids = (
            self.heads[name].take(chosen)
            for name in ("sequence", "publish_time", "log_time", "door_id")
        )
        places: dict[int, NDArray[np.intp]] = {}
        objects: dict[int, list[Event]] = {}
        batch = EventBatch(
            number=self._numbers(sequence),
            kind=kinds.take(chosen),
            happened_ns=happened,
            recorded_ns=recorded,
            columns=LazyColumns(
                places, lambda kind, some: self._rows(kind, chosen[places[kind][some]])
            ),
            objects=objects,
            known_door_ids=door_ids,
            sources_of=sources_of,
        )
        for kind in there:
            mine = batch.places_of(kind)
            if kind in OBJECT_KINDS:
                objects[kind] = [self._object(kind, i) for i in chosen[mine].tolist()]
                door_ids[mine] = [getattr(event, "door_id", 0) for event in objects[kind]]
            else:
                places[kind] = mine
                if kind not in DOOR_KINDS:
                    door_ids[mine] = 0
        for kind in np.unique(kinds[kinds > len(KINDS)]).tolist() if bits & UNKNOWN_BIT else ():
            mine = batch.places_of(kind)
            cls = unknown_kind(kind, name_of(kind, names))
            objects[kind] = [self._unknown(cls, i) for i in chosen[mine].tolist()]
            door_ids[mine] = 0
        return batch

    def commits(self) -> list[Commit]:
        """Return the commits whose Commit record is here, notes included.

        Raises:
            CorruptLogError: One is not what its channel carries.
        """
        places = self.commit_places()
        try:
            if len(places) < np.count_nonzero(self.heads["channel_id"] == COMMIT_CHANNEL):
                raise ValueError("a Commit of a wrong size")  # noqa: TRY301
            return self._commits(places)
        except ValueError as error:
            raise CorruptLogError(self.path, self.offset, str(error)) from None

    def last_commit(self) -> Commit | None:
        """Return its last commit; None: it has none."""
        places = self.commit_places()
        return self._commit(int(places[-1])) if len(places) else None

    def commit_holding(self, event: int) -> Commit | None:
        """Return its first commit that ends with that event or behind it; None: none does."""
        places, ends = self._commit_ends
        found = int(ends.searchsorted(event, "right"))
        return self._commit(int(places[found])) if found < len(places) else None

    @computed_once
    def _commit_ends(self) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
        """Where its Commit messages are, and the number behind the last event of each."""
        places = self.commit_places()
        rows = self.commit_rows(places)
        return places, rows["first_event"].astype(np.int64) + rows["count"]

    def event_numbers(self, *, recorded_by_ns: int | None = None) -> NDArray[np.int64]:
        """Return the numbers of its events, or of those that were recorded by a time."""
        chosen = kinds_of(self.heads["channel_id"]) > 0
        if recorded_by_ns is not None:
            chosen &= self.heads["log_time"] <= recorded_by_ns
        return self._numbers(self.heads["sequence"][chosen])

    def commit_places(self) -> NDArray[np.intp]:
        """Return the places of its Commit messages, as far as they are of the right size."""
        is_commit = self.heads["channel_id"] == COMMIT_CHANNEL
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
        chosen = np.flatnonzero(self.heads["channel_id"] == KEYFRAME_CHANNEL).tolist()
        return [self._payload(i) for i in chosen]

    def _numbers(self, sequence: NDArray[np.uint32]) -> NDArray[np.int64]:
        first = np.uint32(self.first_event & 0xFFFF_FFFF)
        numbers: NDArray[np.int64] = (sequence - first).astype(np.int64)
        numbers += self.first_event
        return numbers

    def _rows(self, kind: int, places: NDArray[np.intp]) -> NDArray[np.void]:
        offsets = self.offsets[places] + mcap.MESSAGE.size
        return gather(self.records, offsets, fixed_layout(kind).dtype)

    def _check_lengths(self, kinds: NDArray[np.uint8], there: Iterable[int]) -> None:
        lengths = np.zeros(256, np.uint64)
        for kind in there:
            if kind not in OBJECT_KINDS:
                lengths[kind] = mcap.MESSAGE_BODY_HEAD + fixed_layout(kind).dtype.itemsize
        others = np.flatnonzero(lengths.take(kinds) != self.heads["length"])
        wrong = kinds[others][lengths[kinds[others]] > 0]
        if len(wrong):
            fixed = fixed_layout(int(wrong[0]))
            raise ValueError(f"a {fixed.name} that is not {fixed.dtype.itemsize} bytes long")

    def _payload(self, i: int) -> bytes:
        start = int(self.offsets[i])
        end = start + mcap.FRAME.size + int(self.heads["length"][i])
        return bytes(self.records[start + mcap.MESSAGE.size : end])

    def _object(self, kind: int, i: int) -> Event:
        level = max(0, int(self.heads["channel_id"][i]) - FLOOR_MAP_CHANNEL)
        return decode(kind, self._payload(i), int(self.heads["publish_time"][i]), level)

    def _unknown(self, cls: type[UnknownEvent], i: int) -> Event:
        return cls(happened_ns=int(self.heads["publish_time"][i]), data=self._payload(i))

    def _commits(self, places: NDArray[np.intp]) -> list[Commit]:
        """Return the commits whose Commit messages are at these places: `_commit` of many."""
        rows = self.commit_rows(places)
        if len(rows) and rows["durability"].max() > max(Durability):
            raise ValueError(f"a Commit of durability {rows['durability'].max()}")
        has_note = (places > 0) & (self.heads["channel_id"][places - 1] == NOTE_CHANNEL)
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
        has_note = i > 0 and bool(self.heads["channel_id"][i - 1] == NOTE_CHANNEL)
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
