"""A segment being read, closed or live: its header and the chunks of its whole commits."""

from __future__ import annotations

import mmap
import os
import stat
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Header, Metadata

from semmap_log.errors import CorruptLogError, LogAccessError, NotALogError
from semmap_log.log import records as mcap
from semmap_log.log.chunks import ChunkDamage, StoredChunk, frames, heads_of, read_chunk_head, walk
from semmap_log.log.form import COMMIT_CHANNEL, KEYFRAME_CHANNEL, LOG_METADATA, PROFILE
from semmap_log.log.header import SegmentHeader

_FOOTER_BYTES = 9 + 20 + len(mcap.MAGIC)


@dataclass(frozen=True, slots=True)
class Segment:
    """What lies in a segment's file, found by walking its records."""

    path: Path
    header: SegmentHeader
    file: memoryview
    """All bytes of the file as it was when it was opened; stays readable if it is replaced."""
    chunks: tuple[StoredChunk, ...]
    """Keyframes and the chunks of whole commits, in file order."""
    closed: bool
    """With index and footer: complete, never modified again."""
    whole_end: int
    """Where the last whole commit (or keyframe) ends."""
    problem: str = ""
    """Why what lies behind `whole_end` does not count; empty if nothing lies there."""

    @property
    def torn_bytes(self) -> int:
        """How many bytes lie behind the last whole commit of a live segment."""
        return 0 if self.closed else len(self.file) - self.whole_end


def open_segment(path: Path) -> Segment:
    """Return the segment in that file.

    Raises:
        NotALogError: The file is not a segment of ours.
        CorruptLogError: It was, and is damaged: in its head or, if closed, anywhere that shows
            without reading every byte; in a live one, before commits that are whole.
        LogAccessError: It cannot be read.
    """
    file = map_file(path)
    header, start = read_head(path, file)
    if _is_closed(file):
        return _scan_closed(path, header, file, start)
    return _scan_live(path, header, file, start)


def read_head(path: Path, file: memoryview) -> tuple[SegmentHeader, int]:
    """Return a segment's own header and where the records behind it begin.

    Raises:
        NotALogError: Not an MCAP file, or one that somebody else wrote.
        CorruptLogError: The header is damaged.
    """
    if file[: len(mcap.MAGIC)] != mcap.MAGIC:
        raise NotALogError(f"{path}: not an MCAP file.")
    records = frames(file, len(mcap.MAGIC), len(file))
    first, second = next(records, None), next(records, None)
    if first is None or second is None or first[0] != Opcode.HEADER:
        raise NotALogError(f"{path}: an MCAP file without a header.")
    frame = mcap.FRAME.size
    try:
        profile = mcap.read_record(Header, file[first[1] + frame : first[1] + first[2]]).profile
        metadata = (
            mcap.read_record(Metadata, file[second[1] + frame : second[1] + second[2]])
            if second[0] == Opcode.METADATA
            else None
        )
        if profile != PROFILE or metadata is None or metadata.name != LOG_METADATA:
            raise NotALogError(
                f"{path}: an MCAP file, but not of a semmap log. "
                "To take its doors into a log: semmap-log import LOG FILE."
            )
        return SegmentHeader.from_metadata(metadata), second[1] + second[2]
    except ValueError as error:
        raise CorruptLogError(path, second[1], str(error)) from None


def map_file(path: Path) -> memoryview:
    """Return a file's bytes as they are now; they stay readable if it is replaced.

    Raises:
        NotALogError: It is no regular file.
        LogAccessError: It cannot be read.
    """
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    try:
        status = os.fstat(fd)
        if not stat.S_ISREG(status.st_mode):
            raise NotALogError(f"{path}: not a regular file.")
        if status.st_size == 0:
            return memoryview(b"")
        return memoryview(mmap.mmap(fd, 0, prot=mmap.PROT_READ))
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    finally:
        os.close(fd)


def _is_closed(file: memoryview) -> bool:
    """Tell whether the file ends in a footer and the magic: no live segment does."""
    if file[-len(mcap.MAGIC) :] != mcap.MAGIC or len(file) < _FOOTER_BYTES:
        return False
    opcode, length = mcap.FRAME.unpack_from(file, len(file) - _FOOTER_BYTES)
    return bool(opcode == Opcode.FOOTER and length == 20)


def _scan_closed(path: Path, header: SegmentHeader, file: memoryview, start: int) -> Segment:
    chunks: list[StoredChunk] = []
    end = start
    for opcode, offset, length in frames(file, start, len(file) - len(mcap.MAGIC)):
        if opcode == Opcode.CHUNK:
            try:
                chunks.append(read_chunk_head(file, offset, length))
            except ChunkDamage as damage:
                raise CorruptLogError(path, offset, str(damage)) from None
        elif opcode == Opcode.DATA_END:
            return Segment(path, header, file, tuple(chunks), closed=True, whole_end=offset)
        end = offset + length
    raise CorruptLogError(path, end, "no record follows where one must")


def _scan_live(path: Path, header: SegmentHeader, file: memoryview, start: int) -> Segment:
    """Walk a live segment, checking all of it; what is behind the last whole commit is left out.

    A torn tail is the normal end of a writer that lost its power: sectors of the last commit are
    missing, in any order. With another whole commit behind it, a bad chunk is damage to what was
    acknowledged.
    """
    whole: list[StoredChunk] = []
    pending: list[StoredChunk] = []
    whole_end, problem, problem_at, reached = start, "", 0, start
    commits_behind = 0
    for opcode, offset, length in frames(file, start, len(file)):
        reached = offset + length
        if opcode == Opcode.MESSAGE_INDEX and whole and not pending and not problem:
            whole_end = reached
        if opcode == Opcode.DATA_END:
            break
        if opcode != Opcode.CHUNK:
            continue
        try:
            chunk = read_chunk_head(file, offset, length)
            completes = _last_channel(chunk, file) in (COMMIT_CHANNEL, KEYFRAME_CHANNEL)
        except ChunkDamage as damage:
            if not problem:
                problem, problem_at = str(damage), offset
            continue
        if problem:
            commits_behind += completes
            if commits_behind > (1 if pending else 0):
                raise CorruptLogError(path, problem_at, f"{problem}; whole commits lie behind it")
            continue
        pending.append(chunk)
        if completes:
            whole += pending
            pending = []
            whole_end = reached
    if not problem and whole_end < len(file):
        problem = "a commit that was not finished" if pending else f"no record at byte {reached}"
    return Segment(
        path, header, file, tuple(whole), closed=False, whole_end=whole_end, problem=problem
    )


def _last_channel(chunk: StoredChunk, file: memoryview) -> int:
    """Return the channel of the chunk's last message, all of the chunk checked."""
    records = chunk.records(file)
    offsets = walk(records)
    if not len(offsets):
        raise ChunkDamage("a chunk without messages")
    return int(heads_of(records, offsets[-1:])["channel_id"][0])
