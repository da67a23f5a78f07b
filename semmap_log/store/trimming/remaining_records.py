"""What is left of closed segments without some of their records, and what is gone.

It is made in one pass, with about a chunk in memory. Commits that lose nothing stay unchanged. Of
those that lose all of their events only the place in the chain stays; of the others the Commit
stays, and a Tombstone with the digests that its hash needs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.messages import layout, read_message, type_name, write_message
from semmap_log.core.model.commits import NO_CONTENT, Note
from semmap_log.store import gone_commands
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    KEYFRAME_CHANNEL,
    NO_HASH,
    NOTE_CHANNEL,
    SEQUENCE_RANGE,
    TOMBSTONE_CHANNEL,
    kind_of_channel,
)
from semmap_log.store.compaction.merge import Pause, no_pause, pages
from semmap_log.store.header import TrimReason
from semmap_log.store.pages import Page
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.segment_set import check_adjoins


class Selection(Protocol):
    """What is to be taken out of a segment."""

    reason: TrimReason
    horizon: int
    """Events below this number go for their age; 0: none does."""
    always_has_horizon: bool
    """It moves there though nothing goes."""

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """Return for each record of a page whether it goes; only events and notes can."""
        ...

    def keyframe(self, data: bytes) -> bytes | None:
        """Return what is left of a Keyframe message; None: it goes, if it is not needed."""
        ...


@dataclass(slots=True)
class _OpenCommit:
    """A commit of which some records have come, and its Commit has not."""

    digests: dict[int, tuple[Any, Any]] = field(default_factory=dict)
    """Channel -> sha256 of all its records so far, and of those that stay."""
    lacking: set[int] = field(default_factory=set)
    """Channels that lose some now."""
    events_kept: int = 0
    events_gone: int = 0
    notes_gone: int = 0
    note: bytes = b""
    written_note: bytes = b""
    """As it is in the segment."""
    content: gone_commands.Content = field(default_factory=gone_commands.Content)
    before: gone_commands.Tombstone | None = None
    """What it lacked already."""

    def take(self, channel: int, written: bytes | memoryview, left: bytes | memoryview) -> None:
        """Take a record in.

        Args:
            channel: Its channel.
            written: As it is in the segment.
            left: What stays of it; empty: nothing.
        """
        if channel not in self.digests:
            self.digests[channel] = hashlib.sha256(), hashlib.sha256()
        whole, kept = self.digests[channel]
        whole.update(written)
        kept.update(left)
        if left is not written:
            self.lacking.add(channel)

    def tombstone(self, said: dict[str, Any], reason: TrimReason) -> gone_commands.Tombstone | None:
        """Return what stands for what it lacks; None: it lacks nothing.

        Args:
            said: The fields of its Commit.
            reason: Why something is taken out now.
        """
        before = self.before
        known = {} if before is None else {part.channel: part.digest for part in before.parts}
        lost = [self._part(channel, known) for channel in sorted(self.lacking | known.keys())]
        if not lost and before is None:
            return None
        return gone_commands.Tombstone(
            said["first_event"],
            said["count"],
            0,
            said["count"] - self.events_kept,
            self.notes_gone + (0 if before is None else before.notes_gone),
            (reason if self.lacking else TrimReason(0))
            | (TrimReason(0) if before is None else before.reasons),
            hash=self.seal(said),
            parts=tuple(lost),
        )

    def seal(self, said: dict[str, Any]) -> bytes:
        """Return the packed seal of its command; zeros: nobody can send it again.

        Args:
            said: The fields of its Commit.
        """
        content = bytes(said["content"])
        if content == NO_CONTENT:
            return NO_HASH
        recorded_ns = said["log_time"] - said["count"] - bool(self.written_note)
        if self.before is not None:
            unknown = gone_commands.CommandSeal(
                gone_commands.UNKNOWN, gone_commands.UNKNOWN, 0, recorded_ns, 0, said["count"]
            )
            return self.before.hash if self.before.hash != NO_HASH else unknown.packed()
        note = Note()
        if self.written_note:
            texts = read_message(type_name("CommitNote"), self.written_note[mcap.MESSAGE.size :])
            note = Note(**(texts | {"salt": b""}))
        return self.content.seal(said["command_id"], content, note, recorded_ns).packed()

    def _part(self, channel: int, known: dict[int, bytes]) -> gone_commands.LostPart:
        whole, kept = self.digests.get(channel, (None, None))
        is_empty = kept is None or kept.digest() == _EMPTY
        digest = known[channel] if channel in known else whole.digest()
        return gone_commands.LostPart(channel, digest, NO_HASH if is_empty else kept.digest())


class KeptRecords(NamedTuple):
    """Some of the records that are left."""

    records: bytes
    next_event: int
    """Number of the first event after them."""


class RemainingRecords:
    """A pass over adjacent segments, and what goes in it."""

    def __init__(self, sources: Sequence[Segment], selection: Selection) -> None:
        """Begin; nothing is read yet."""
        self.sources = sources
        self.events_gone = 0
        """Now, not before."""
        self.notes_gone = 0
        self.changes_keyframes = False
        """Whether one of them goes, or says less."""
        self._next_event = sources[0].header.first_event
        self._selection = selection
        before = [segment.header.trimmed for segment in sources]
        horizons = (one.horizon for one in before if one is not None)
        self._horizon = max(selection.horizon, *horizons, 0)
        self._open: _OpenCommit | None = None
        self._run: gone_commands.Tombstone | None = None
        """Whole commits that are gone, right before what comes next …"""
        self._run_ns = 0
        """… and the log time of the last of them."""
        self._kept: list[bytes | memoryview] = []
        self._size = 0
        self._ready: list[KeptRecords] = []
        self._has_keyframe = False
        self._heads = {segment.head for segment in sources}

    @property
    def is_changed(self) -> bool:
        """Whether anything goes."""
        is_less = self.events_gone or self.notes_gone or self.changes_keyframes
        return bool(is_less or self._selection.always_has_horizon)

    def parts(self, pause: Pause = no_pause) -> Iterator[KeptRecords]:
        """Yield the records that are left, in parts of about a chunk, a keyframe by itself.

        Args:
            pause: Called between parts.

        Raises:
            CorruptLogError: A segment is damaged.
        """
        for before, segment in pairwise(self.sources):
            check_adjoins(segment, before)
        for page in pages(self.sources, pause):
            if page.heads["channel_id"][0] == KEYFRAME_CHANNEL:
                self._keyframe(page)
            else:
                self._page(page)
            yield from self._taken()
            pause(len(page.records))
        self._flush()
        yield from self._taken()

    def _taken(self) -> Iterator[KeptRecords]:
        ready, self._ready = self._ready, []
        yield from ready

    def _page(self, page: Page) -> None:
        """Take the records of whole chunks, commit by commit; what loses nothing in one go."""
        ends = page.commit_places() + 1
        starts = np.append(0, ends)
        gone = self._selection.gone(page)
        touched = np.flatnonzero(gone | (page.heads["channel_id"] == TOMBSTONE_CHANNEL))
        slow = np.unique(np.searchsorted(ends, touched, "right")).tolist()
        if self._open is not None:
            slow = [0, *(one for one in slow if one)]
        if starts[-1] < len(page.offsets) and len(ends) not in slow:
            slow.append(len(ends))
        done = 0
        for commit in slow:
            self._copy(page, int(starts[done]), int(starts[commit]))
            end = int(ends[commit]) if commit < len(ends) else len(page.offsets)
            self._commit(page, int(starts[commit]), end, gone)
            done = commit + 1
        if done < len(ends):
            self._copy(page, int(starts[done]), int(ends[-1]))

    def _copy(self, page: Page, start: int, end: int) -> None:
        """Copy whole commits as they are."""
        if start < end:
            last = page.commit_rows(np.array([end - 1]))[0]
            ends = int(page.offsets[end]) if end < len(page.offsets) else len(page.records)
            self._put(page.records[int(page.offsets[start]) : ends])
            self._next_event = int(last["first_event"]) + int(last["count"])
            self._flush_if_full()

    def _commit(self, page: Page, start: int, end: int, gone: NDArray[np.bool_]) -> None:
        """Take the records of one commit, or as many of them as the page has."""
        channels = page.heads["channel_id"][start:end].tolist()
        numbers = page.numbers(np.arange(start, end)).tolist()
        for i, channel, number in zip(range(start, end), channels, numbers, strict=True):
            record = page.record(i)
            if channel == TOMBSTONE_CHANNEL:
                self._tombstone(record, page, i)
                continue
            self._open = self._open or _OpenCommit()
            if channel == COMMIT_CHANNEL:
                self._close_commit(self._open, record, int(page.heads["log_time"][i]))
                self._open = None
            elif channel == NOTE_CHANNEL:
                self._note(self._open, record, is_gone=bool(gone[i]))
            else:
                self._event(self._open, channel, record, number, is_gone=bool(gone[i]))
        self._flush_if_full()

    def _tombstone(self, record: bytes | memoryview, page: Page, i: int) -> None:
        """Take in what was taken out before."""
        before = gone_commands.read_tombstone(record, page.path)
        if before.commits:
            self._extend_run(before, int(page.heads["log_time"][i]))
        else:
            self._open = self._open or _OpenCommit()
            self._open.before = before

    def _event(
        self,
        commit: _OpenCommit,
        channel: int,
        record: bytes | memoryview,
        number: int,
        *,
        is_gone: bool,
    ) -> None:
        commit.take(channel, record, b"" if is_gone else record)
        happened_ns = mcap.MESSAGE.unpack_from(record)[5]
        kind = kind_of_channel(channel) or 0
        commit.content.add(kind, happened_ns, bytes(record[mcap.MESSAGE.size :]))
        commit.events_gone += is_gone
        commit.events_kept += not is_gone
        if not is_gone:
            self._put(record)
            self._next_event = number + 1

    def _note(self, commit: _OpenCommit, record: bytes | memoryview, *, is_gone: bool) -> None:
        """A note that goes leaves a blank one: by it the commit's time is found."""
        commit.written_note = bytes(record)
        commit.note = _blank_note(record) if is_gone else commit.written_note
        is_gone = is_gone and commit.note != bytes(record)  # one that is blank already
        commit.take(NOTE_CHANNEL, record, commit.note if is_gone else record)
        commit.notes_gone += is_gone

    def _close_commit(self, commit: _OpenCommit, record: bytes | memoryview, time_ns: int) -> None:
        said = layout("Commit").unpack(record, mcap.MESSAGE.size) | {"log_time": time_ns}
        before = commit.before
        is_last = bytes(said["hash"]) in self._heads  # by it the next segment is known to follow
        self.events_gone += commit.events_gone
        had_note = bool(commit.note) and (before is None or not before.notes_gone)
        has_note = had_note and not commit.notes_gone
        stays = is_last or (has_note and self._selection.reason is TrimReason.REDACTED)
        if not commit.events_kept and commit.events_gone and not stays:
            self.notes_gone += had_note
            self._extend_run(_whole(said, commit, self._selection.reason), time_ns)
            return
        self.notes_gone += commit.notes_gone
        found = commit.tombstone(said, self._selection.reason)
        left = b"" if found is None else found.record(time_ns - 1 - bool(commit.note))
        self._put(left + commit.note + bytes(record))
        self._next_event = said["first_event"] + said["count"]

    def _extend_run(self, more: gone_commands.Tombstone, time_ns: int) -> None:
        run = self._run
        if run is not None and len(run.parts) + len(more.parts) > MOST_COMMANDS:
            self._end_run()
            run = None
        self._run_ns = time_ns
        self._run = more if run is None else replace(
            run,
            count=run.count + more.count,
            commits=run.commits + more.commits,
            events_gone=run.events_gone + more.events_gone,
            notes_gone=run.notes_gone + more.notes_gone,
            reasons=run.reasons | more.reasons,
            hash=more.hash,
            parts=run.parts + gone_commands.moved(more.parts, run.count),
        )  # fmt: skip

    def _keyframe(self, page: Page) -> None:
        (data,) = page.keyframes()
        left = self._selection.keyframe(data)
        sequence, time_ns = int(page.heads["sequence"][0]), int(page.heads["log_time"][0])
        if sequence != (self._next_number() - 1) % SEQUENCE_RANGE:
            return  # within a commit, after events that are gone: no reader would find its place
        is_needed = not self._has_keyframe or sequence == (self._horizon - 1) % SEQUENCE_RANGE
        if left is None and not is_needed:
            return
        self._has_keyframe = True
        self._end_run()
        self._flush()
        self.changes_keyframes |= left not in (None, data)
        data = data if left is None else left
        self._put(mcap.message(KEYFRAME_CHANNEL, sequence, time_ns, time_ns, data))
        self._flush()

    def _next_number(self) -> int:
        """Return the number that a reader expects next, after what is left so far."""
        return self._next_event if self._run is None else self._run.next_event

    def _put(self, records: bytes | memoryview) -> None:
        self._end_run()
        self._kept.append(records)
        self._size += len(records)

    def _end_run(self) -> None:
        run, self._run = self._run, None
        if run is not None:
            self._put(run.record(self._run_ns))
            self._next_event = run.next_event

    def _flush_if_full(self) -> None:
        if self._size >= CHUNK_BYTES:
            self._flush()

    def _flush(self) -> None:
        """Make a part of what is there."""
        if self._size:
            self._ready.append(KeptRecords(b"".join(self._kept), self._next_event))
            self._kept, self._size = [], 0


MOST_COMMANDS = 4096
"""Of so many a Tombstone keeps what answers them; then comes another."""
_EMPTY = hashlib.sha256().digest()


def _whole(
    said: dict[str, Any], commit: _OpenCommit, reason: TrimReason
) -> gone_commands.Tombstone:
    """Return what stands for a commit of which nothing is left."""
    before = commit.before
    seal = gone_commands.CommandSeal.unpacked(commit.seal(said))
    return gone_commands.Tombstone(
        said["first_event"],
        said["count"],
        1,
        said["count"],
        int(bool(commit.note)),
        reason | (TrimReason(0) if before is None else before.reasons),
        bytes(said["previous_hash"]),
        bytes(said["hash"]),
        () if seal is None else (gone_commands.part_of(said["command_id"], seal),),
    )


def _blank_note(record: bytes | memoryview) -> bytes:
    """Return a note that says nothing, in the place of another."""
    _, _, channel, sequence, log_ns, publish_ns = mcap.MESSAGE.unpack_from(record)
    said = {"salt": bytes(16), "actor": "", "source": "", "reason": "", "correlation": ""}
    data = write_message(type_name("CommitNote"), said)
    return mcap.message(channel, sequence, log_ns, publish_ns, data)
