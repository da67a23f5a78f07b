"""What answers of a log rest on, and no hash of its commits binds.

A Tombstone vouches for what is left of its commits, but nothing in the log vouches for the
Tombstone. A keyframe in a trimmed segment, or at the head of the next, cannot be computed from the
events that are left. Nor is what the heads of segments say in any commit. A statement signs the
digest of all of this: `taken`.
"""

from __future__ import annotations

import hashlib
import json
import struct

from semmap_log.core.model.moments import USUAL_HOLDS
from semmap_log.store.header import LogInfo, SegmentHeader

_ITEM = struct.Struct("<cQ")


class Unbound:
    """Takes the records of a log in file order; its digest is that of all up to the last commit.

    Each item is a letter, its length as u64, and its bytes: `i` a JSON list of timezone, building,
    robot and, if it is there, holds (a number), where a head says others than the one before; `s`
    a JSON list of what the head of a trimmed segment says (first event, next event, reasons,
    horizon); `t` the whole Message record of a Tombstone; `k` that of a keyframe that cannot be
    checked.
    """

    def __init__(self) -> None:
        self.keyframes = 0
        """How many cannot be checked by a replay."""
        self.before = 0
        """Number of the first event after all that was taken out, and after the horizon."""
        self._digest = hashlib.sha256(b"semmap-log taken 1\n")
        self._waiting: list[tuple[bytes, bytes]] = []
        """Items that no commit has followed yet."""
        self._info: LogInfo | None = None
        self._is_trimmed = False
        self._takes_next = False
        """Whether the next keyframe follows a trimmed segment, as the head of the next."""

    def begin_segment(self, header: SegmentHeader) -> None:
        """Take in what the head of the next segment says."""
        info, trimmed = header.info, header.trimmed
        if info != self._info:
            holds = () if info.holds == USUAL_HOLDS else (info.holds,)
            self._wait(b"i", _json(info.timezone, info.building, info.robot, *holds))
        self._takes_next = self._is_trimmed and trimmed is None
        self._info, self._is_trimmed = info, trimmed is not None
        if trimmed is not None:
            said = (header.first_event, trimmed.next_event, int(trimmed.reasons), trimmed.horizon)
            self._wait(b"s", _json(*said))
            self.before = max(self.before, trimmed.horizon)

    def add_keyframe(self, record: bytes | memoryview) -> None:
        """Take in a keyframe, if nothing else vouches for it."""
        if self._is_trimmed or self._takes_next:
            self.keyframes += 1
            self._wait(b"k", bytes(record))
            self._takes_next = False

    def add_tombstone(self, record: bytes | memoryview, next_event: int) -> None:
        """Take in a Tombstone, and the number after its last event."""
        self.settle()
        self._take(b"t", bytes(record))
        self.before = max(self.before, next_event)

    def settle(self) -> None:
        """A commit has followed: what was before it counts."""
        self._takes_next = False
        for letter, data in self._waiting:
            self._take(letter, data)
        self._waiting.clear()

    @property
    def digest(self) -> bytes:
        """SHA-256 of all that was before the end of the last commit."""
        return self._digest.digest()

    def _wait(self, letter: bytes, data: bytes) -> None:
        self._waiting.append((letter, data))

    def _take(self, letter: bytes, data: bytes) -> None:
        self._digest.update(_ITEM.pack(letter, len(data)) + data)


def _json(*values: str | int) -> bytes:
    return json.dumps(values, separators=(",", ":")).encode()
