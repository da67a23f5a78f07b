"""A log made small: closed segments in large compressed chunks, small ones merged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePath

from semmap_log.core.io.progress import Progress
from semmap_log.core.io.virtual_logs import check_not_virtual
from semmap_log.errors import CorruptLogError, LogAccessError, SemmapError
from semmap_log.store.bag_metadata import write_bag_metadata
from semmap_log.store.byte_layout import count_events
from semmap_log.store.compaction.merge import (
    MergedFiles,
    Pause,
    Step,
    needs_compaction,
    no_pause,
    plan,
    rechunked,
)
from semmap_log.store.folder import LogFolder
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_folder import check_is_log
from semmap_log.store.reading.segment_reading import statistics_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.removed_part import read_removed_part
from semmap_log.store.segment import SegmentWriter


@dataclass(frozen=True, slots=True)
class Compacted:
    """What a compaction did to the closed segments, or would do."""

    segments_before: int
    segments_after: int
    bytes_before: int
    bytes_after: int | None
    """None where it was only planned."""
    events: int
    """In all closed segments."""
    steps: tuple[tuple[PurePath, ...], ...]
    """For each file that was written: what it was made of; it has the first one's name."""
    merged_files: int = 0
    """Files that lie in merged ones, and stay until no copy of the folder can need them."""
    merged_bytes: int = 0
    """What they take."""


def compact(
    path: Path,
    *,
    merge: bool = True,
    keep_s: float | None = None,
    progress: Progress | None = None,
) -> Compacted:
    """Rechunk the closed segments of a log, and merge small ones that follow each other.

    The live segment is not touched. Stopped at any point, by whatever, the folder holds the log.

    Args:
        path: The log's folder.
        merge: Merge small segments, up to 64 MiB of records in a file.
        keep_s: How long the files stay that were merged into another, for copies of the folder
            that are under way; default: an hour. The first writer or compaction after that
            removes them.
        progress: Called with the progress of the work.

    Raises:
        LogLockedError: Another process is writing.
        LogAccessError: The file system refuses; what was done until then stays done.
        CorruptLogError: A segment is damaged; it and those after it stay as they are.
    """
    check_not_virtual(path)
    check_is_log(LogFolder(path))
    folder = LogFolder.held(path)
    lock = WriterLock(folder)
    try:
        folder.remove_stale_files()
        _remove_merged(folder, keep_s)
        done = _compact(folder, merge=merge, progress=progress)
        left = _remove_merged(folder, keep_s)
        return replace(done, merged_files=len(left), merged_bytes=sum(left))
    except LogAccessError:
        raise
    except OSError as error:
        problem = f"{path}: cannot be compacted: {error.strerror or error}. The log is whole."
        raise LogAccessError(problem) from error
    finally:
        lock.release()


def plan_compaction(path: Path, *, merge: bool = True) -> Compacted:
    """Return what `compact` would do; needs no lock and no write access."""
    check_not_virtual(path)
    closed = _closed(LogFolder(path))
    steps = plan(closed, merge=merge)
    merged_away = sum(len(step.sources) - 1 for step in steps)
    return _summary(closed, steps, len(closed) - merged_away, None)


def _remove_merged(folder: LogFolder, keep_s: float | None) -> list[int]:
    """Remove what lies in merged files, if they are old enough; return the sizes of what stays."""
    reader = LogReader(folder)
    left = MergedFiles.of(reader.segments, reader.leftovers).remove(folder, keep_s)
    return [folder.status(name).st_size for name in left.parts]


def _compact(folder: LogFolder, *, merge: bool, progress: Progress | None) -> Compacted:
    before = _closed(folder)
    steps = plan(before, merge=merge)
    pause = _told(progress, sum(2 * step.size for step in steps)) if progress else no_pause
    listed = {segment.path: statistics_of(segment) for segment in before}
    try:
        for step in steps:
            listed = step.run(folder, listed, pause)
    except BaseException:
        with suppress(SemmapError, OSError):
            _list_closed(folder)  # leftovers wait for the next time: see `remove_merged`
        raise
    after = _list_closed(folder)
    return _summary(before, steps, len(after), sum(segment.size for segment in after))


def _told(progress: Progress, total: int) -> Pause:
    done = 0

    def pause(more: int) -> None:
        nonlocal done
        done += more
        progress(done, total)

    return pause


def _closed(folder: LogFolder) -> list[Segment]:
    """Return the closed segments that lie here, and that no removal is about to remove."""
    part = read_removed_part(folder)
    removed = set() if part is None else {file for file, _ in part.files}
    return [
        one for one in LogReader(folder).segments if one.closed and one.path.name not in removed
    ]


def _list_closed(folder: LogFolder) -> list[Segment]:
    """Bring metadata.yaml up to date; return what it lists."""
    closed = _closed(folder)
    write_bag_metadata(folder, [statistics_of(segment) for segment in closed])
    return closed


def _summary(
    before: Sequence[Segment], steps: Sequence[Step], segments_after: int, bytes_after: int | None
) -> Compacted:
    return Compacted(
        segments_before=len(before),
        segments_after=segments_after,
        bytes_before=sum(segment.size for segment in before),
        bytes_after=bytes_after,
        events=sum(_events(segment) for segment in before),
        steps=tuple(tuple(source.path for source in step.sources) for step in steps),
    )


def _events(segment: Segment) -> int:
    return count_events(statistics_of(segment).counts)


def install_over(copy: SegmentWriter, replaced: Segment) -> None:
    """Put a closed copy in the place of the segment that it was made of.

    Raises:
        OSError: As the file system says, or another file has its name now.
    """
    copy.install(replacing=replaced.source.identity)


def compact_segment(
    folder: LogFolder,
    name: str,
    *,
    pause: Pause = no_pause,
    install: Callable[[SegmentWriter, Segment], None] = install_over,
) -> bool:
    """Replace a closed segment by its compacted copy; at every instant one of both is there.

    Args:
        folder: The log's.
        name: Its file there.
        pause: Called between chunks; what it raises stops the work, and the old segment stays.
        install: Called with the copy, closed, synced and compared, and with the segment: to put
            one in the place of the other.

    Returns:
        Whether it was replaced; False where there is nothing to gain.

    Raises:
        CorruptLogError: It is damaged, or not closed; it stays as it is.
        OSError: As the file system says; it stays as it is.
    """
    path = folder / name
    segment = open_segment(path, folder=folder)
    if not segment.closed:
        raise CorruptLogError(path, segment.valid_end, "not closed, so it cannot be compacted")
    if not needs_compaction(segment):
        return False
    with rechunked(folder, [segment], pause) as copy:
        install(copy, segment)
    return True
