"""Records of one or more chunks, taken apart into events, commits and keyframes."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.commits import Commit, Durability, Note
from semmap_log.errors import CorruptLogError
from semmap_log.event_batch import EventBatch
from semmap_log.events import Event
from semmap_log.log import records as mcap
from semmap_log.log.chunks import ChunkDamage, gather, heads_of, walk
from semmap_log.log.form import (
    COMMIT_CHANNEL,
    FLOOR_MAP_CHANNEL,
    KEYFRAME_CHANNEL,
    NOTE_CHANNEL,
    kind_of_channel,
)
from semmap_log.messages import (
    OBJECT_KINDS,
    decode,
    deserialize,
    fixed_layout,
    layout,
    type_name,
)

_KIND_OF_CHANNEL = np.array(
    [kind_of_channel(channel) or 0 for channel in range(FLOOR_MAP_CHANNEL + 1)], np.uint8
)


@dataclass(frozen=True)
class Page:
    """Message records that follow each other in a segment, whole chunks joined."""

    records: bytes | memoryview
    first_event: int
    """Event number at which their segment begins: `sequence` has the low 32 bits only."""
    path: Path
    """Their file, for messages."""
    offset: int = 0
    """Where their first chunk lies in it, for messages."""

    @cached_property
    def offsets(self) -> NDArray[np.int64]:
        """Where each record begins.

        Raises:
            CorruptLogError: They are not messages, one after the other.
        """
        try:
            return walk(self.records)
        except ChunkDamage as damage:
            raise CorruptLogError(self.path, self.offset, str(damage)) from None

    @cached_property
    def heads(self) -> NDArray[np.void]:
        """The fixed fields of each record, as MESSAGE_DTYPE."""
        return heads_of(self.records, self.offsets)

    @property
    def levels(self) -> set[int]:
        """Levels whose floor map is here."""
        channels = np.unique(self.heads["channel_id"])
        return set((channels[channels >= FLOOR_MAP_CHANNEL] - FLOOR_MAP_CHANNEL).tolist())

    def events(self) -> EventBatch:
        """Return its events as columns.

        Raises:
            CorruptLogError: A record's payload is not what its channel carries.
        """
        try:
            return self._events()
        except ValueError as error:
            raise CorruptLogError(self.path, self.offset, str(error)) from None

    def _events(self) -> EventBatch:
        channels = self.heads["channel_id"]
        kinds = _KIND_OF_CHANNEL[np.minimum(channels, FLOOR_MAP_CHANNEL)]
        chosen = np.flatnonzero(kinds)
        heads, kinds, offsets = self.heads[chosen], kinds[chosen], self.offsets[chosen]
        columns: dict[int, NDArray[np.void]] = {}
        objects: dict[int, list[Event]] = {}
        for kind in np.flatnonzero(np.bincount(kinds)).tolist():
            mine = np.flatnonzero(kinds == kind)
            if kind in OBJECT_KINDS:
                objects[kind] = [self._object(kind, chosen[i]) for i in mine]
            else:
                columns[kind] = self._columns(kind, heads[mine], offsets[mine])
        return EventBatch(
            number=self._numbers(heads["sequence"]),
            kind=kinds,
            happened_ns=np.ascontiguousarray(heads["publish_time"]),
            recorded_ns=np.ascontiguousarray(heads["log_time"]),
            columns=columns,
            objects=objects,
        )

    def commits(self) -> list[Commit]:
        """Return the commits whose Commit record is here, notes included.

        Raises:
            CorruptLogError: One is not what its channel carries.
        """
        chosen = np.flatnonzero(self.heads["channel_id"] == COMMIT_CHANNEL).tolist()
        try:
            return [self._commit(i) for i in chosen]
        except (ValueError, struct.error) as error:
            raise CorruptLogError(self.path, self.offset, str(error)) from None

    def keyframes(self) -> list[bytes]:
        """Return the CDR bytes of its Keyframe messages."""
        chosen = np.flatnonzero(self.heads["channel_id"] == KEYFRAME_CHANNEL).tolist()
        return [self._payload(i) for i in chosen]

    def _numbers(self, sequence: NDArray[np.uint32]) -> NDArray[np.int64]:
        first = np.uint32(self.first_event & 0xFFFF_FFFF)
        numbers: NDArray[np.int64] = (sequence - first).astype(np.int64)
        numbers += self.first_event
        return numbers

    def _columns(
        self, kind: int, heads: NDArray[np.void], offsets: NDArray[np.int64]
    ) -> NDArray[np.void]:
        fixed = fixed_layout(kind)
        dtype = fixed.behind(mcap.MESSAGE_DTYPE)
        if not (heads["length"] == dtype.itemsize - mcap.FRAME.size).all():
            raise ValueError(f"a {fixed.name} that is not {fixed.dtype.itemsize} bytes long")
        return gather(self.records, offsets, dtype)[list(fixed.fields)]

    def _payload(self, i: int) -> bytes:
        start = int(self.offsets[i])
        end = start + mcap.FRAME.size + int(self.heads["length"][i])
        return bytes(self.records[start + mcap.MESSAGE.size : end])

    def _object(self, kind: int, i: int) -> Event:
        head = self.heads[i]
        level = max(0, int(head["channel_id"]) - FLOOR_MAP_CHANNEL)
        return decode(kind, self._payload(i), int(head["publish_time"]), level)

    def _commit(self, i: int) -> Commit:
        fields: dict[str, Any] = layout("Commit").unpack(self._payload(i))
        has_note = i > 0 and bool(self.heads["channel_id"][i - 1] == NOTE_CHANNEL)
        fields["durability"] = Durability(fields["durability"])
        closed_ns = int(self.heads["log_time"][i])
        return Commit(
            recorded_ns=closed_ns - fields["count"] - has_note,
            closed_ns=closed_ns,
            note=self._note(i - 1) if has_note else Note(),
            **fields,
        )

    def _note(self, i: int) -> Note:
        said = deserialize(type_name("CommitNote"), self._payload(i))
        return Note(said.actor, said.source, said.reason, said.correlation, bytes(said.salt))
