"""A log made small: closed segments in large compressed chunks."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from semmap_log.errors import CorruptLogError
from semmap_log.log.bag_metadata import statistics_of, write_bag_metadata
from semmap_log.log.form import CHUNK_BYTES
from semmap_log.log.lock import WriterLock
from semmap_log.log.reader import LogReader, check_is_log
from semmap_log.log.rechunk import Pause, needs_compaction, no_pause, rechunked
from semmap_log.log.scan import open_segment
from semmap_log.log.segment import SegmentWriter


@dataclass(frozen=True, slots=True)
class Compacted:
    """What a compaction did."""

    segments: int
    bytes_before: int
    bytes_after: int


def compact(folder: Path) -> Compacted:
    """Rechunk every closed segment of a log to zstd chunks of about a MiB.

    Raises:
        LogLockedError: Somebody is writing.
        CorruptLogError: A segment is damaged; it is left as it is.
    """
    check_is_log(folder)
    lock = WriterLock(folder)
    try:
        segments = [segment for segment in LogReader(folder).segments if segment.closed]
        before = sum(len(segment.file) for segment in segments)
        for segment in segments:
            compact_segment(segment.path)
        closed = [open_segment(segment.path) for segment in segments]
        write_bag_metadata(folder, [statistics_of(s.path, s.file) for s in closed])
    finally:
        lock.release()
    return Compacted(len(segments), before, sum(len(segment.file) for segment in closed))


def compact_segment(
    path: Path,
    *,
    pause: Pause = no_pause,
    install: Callable[[SegmentWriter], None] = SegmentWriter.install,
) -> bool:
    """Replace a closed segment by its compacted copy; at every instant one of both is there.

    Args:
        path: Its file.
        pause: Called between chunks; what it raises stops the work, and the old segment stays.
        install: Called with the copy, closed, synced and compared: to put it in place.

    Returns:
        Whether it was replaced; False where there is nothing to gain.

    Raises:
        CorruptLogError: It is damaged, or not closed; it stays as it is.
        OSError: As the file system says; it stays as it is.
    """
    _read_through(path, pause)
    segment = open_segment(path)
    if not segment.closed:
        raise CorruptLogError(path, segment.whole_end, "not closed, so it cannot be compacted")
    if not needs_compaction(segment):
        return False
    with rechunked([segment], pause) as copy:
        install(copy)
    return True


def _read_through(path: Path, pause: Pause) -> None:
    """Read a file once, by calls: a sector that cannot be read is then an error.

    Met through a mapped file, it would end the process: a robot's recorder, with its writer.
    """
    with path.open("rb", buffering=0) as file:
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_SEQUENTIAL)
        block = bytearray(CHUNK_BYTES)
        while file.readinto(block):
            pause(0)
