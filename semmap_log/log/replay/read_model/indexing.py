"""Makes the read model: the tables of each closed segment that has none, or none that fit."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from semmap_log import errors
from semmap_log.core.io.disk import TEMPORARY_SUFFIX
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazily import late_pattern
from semmap_log.log.replay.read_model import events_about
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import NotesByCommit, batches_of
from semmap_log.store.reading.segment_scan import Segment

SAMPLED = 4096
"""Rows by which it is chosen how columns are stored."""


@dataclass(slots=True)
class Indexed:
    """What was done."""

    segments: int = 0
    """Closed segments of the log."""
    made: list[str] = field(default_factory=list)
    """Segments whose tables were made now."""
    removed: list[str] = field(default_factory=list)
    """Files that belonged to no segment any more."""
    skipped: list[str] = field(default_factory=list)
    """Segments with events of a later version, which are read from the log."""
    events: int = 0
    """Events that were read for it."""
    size: int = 0
    """Bytes of all tables."""
    log_size: int = 0
    """Bytes of their segments."""


def index(
    log: Path,
    *,
    anew: bool = False,
    thorough: bool = True,
    progress: Progress | None = None,
    pause: Callable[[], None] | None = None,
) -> Indexed:
    """Make the tables that are missing, and remove those that are of no segment.

    From then on whoever writes the log keeps them up, and whoever asks it uses them. Stopped at any
    moment it leaves whole tables or none. Nobody else is held up.

    Args:
        log: Its folder.
        anew: Make all of them again, also those that are good.
        thorough: Read existing ones, and make damaged ones again.
        progress: Called with the number of events done.
        pause: Called between two pieces of work; what it raises ends it.

    Raises:
        MissingExtraError: pyarrow is not installed.
        LogLockedError: Another process is at it.
        OutputError: The disk does not let us; the log is as it was.
        CorruptLogError: A segment is damaged.
    """
    from semmap_log.core.arrow import history_table  # noqa: F401 - reports a missing pyarrow first

    reader = LogReader(log)
    folder = _folder_of(reader)
    try:
        if folder.is_symlink():
            raise errors.LogAccessError(
                f"{folder}: expected a folder of this log, got a link; remove it."
            )
        folder.mkdir(exist_ok=True)
        with _alone(folder):
            return _index(
                reader, folder, anew=anew, thorough=thorough, progress=progress, pause=pause
            )
    except errors.LogError:
        raise
    except OSError as error:
        raise errors.OutputError(
            f"{folder}: could not be written: {error.strerror or error}. The log is as it was; "
            "what the index lacks is read from the log."
        ) from error


def keep_up(log: Path, pause: Callable[[], None]) -> None:
    """Bring the read model of a log up to date, if it has one and nobody else is at it.

    Args:
        log: Its folder.
        pause: As for `index`.
    """
    if (log / events_about.FOLDER).is_dir() and events_about.has_pyarrow():
        with suppress(errors.LogLockedError):
            index(log, thorough=False, pause=pause)


@dataclass(frozen=True, slots=True)
class IndexState:
    """How far the read model of a log is."""

    segments: int
    """Closed segments of the log."""
    indexed: int
    """Those that have tables which fit."""
    size: int
    """Bytes of its files."""


def _indexable(reader: LogReader) -> list[Segment]:
    """Return the segments of which there can be tables: closed ones that are here, and whole."""
    return [
        segment
        for segment in reader.segments
        if segment.closed and segment.told is None and segment.header.trimmed is None
    ]


def remove_stale_tables(log: Path) -> None:
    """Remove the tables of segments that are not there any more, or were trimmed since.

    Raises:
        LogAccessError: The file system does not let us.
    """
    folder = log / events_about.FOLDER
    if not folder.is_dir():
        return
    try:
        _tidied(folder, {s.path.stem for s in _indexable(LogReader(log))})
    except OSError as error:
        raise errors.LogAccessError(
            f"{folder}: cannot be tidied: {error.strerror or error}."
        ) from error


def remove_stale_tables_alone(log: Path) -> None:
    """Do the same as `remove_stale_tables`; nobody else makes tables meanwhile.

    Raises:
        LogLockedError: Somebody does, perhaps of segments as they were before they were trimmed.
        LogAccessError: The file system does not let us.
    """
    with _alone(log / events_about.FOLDER):
        remove_stale_tables(log)


def index_state(reader: LogReader) -> IndexState | None:
    """Return how far the read model of a log is; None: it has none."""
    if not isinstance(reader.given, Path) or not (reader.given / events_about.FOLDER).is_dir():
        return None
    folder = reader.given / events_about.FOLDER
    closed = _indexable(reader)
    indexed = sum(_is_good(folder, segment, thorough=False) for segment in closed)
    return IndexState(len(closed), indexed, sum(map(_size_of, _files_in(folder))))


def _files_in(folder: Path) -> list[Path]:
    """Return the files of a folder; none, if it may not be looked into."""
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def _size_of(file: Path) -> int:
    """Return the size of a file; 0, if it has gone meanwhile."""
    try:
        return file.lstat().st_size
    except OSError:
        return 0


def index_problems(log: Path) -> list[tuple[Path, str]]:
    """Read the tables of a log, and return which are not to be used, and why.

    Raises:
        LogError: The log itself cannot be read.
    """
    folder = log / events_about.FOLDER
    if not folder.is_dir() or not events_about.has_pyarrow():
        return []
    try:
        files = sorted(folder.iterdir())
    except OSError as error:
        return [(folder, f"{folder}: cannot be read: {error.strerror}.")]
    told = [file for file in files if file.suffix == ".json" and _stem_of(file.name)]
    found = [(file, problem) for file, problem in _problems(log, told) if problem]
    # another process may be making them again right now: a real fault is found twice
    return [(file, problem) for file, problem in _problems(log, [f for f, _ in found]) if problem]


def _problems(log: Path, told: Sequence[Path]) -> Iterator[tuple[Path, str]]:
    """Yield the problems of the tables that these files describe."""
    if not told:
        return
    segments = _indexable(LogReader(log))
    known = {segment.path.stem: segment for segment in segments}
    for file in told:
        segment = known.get(file.stem)
        if segment is not None:
            yield file, _problem(file.parent, segment)
        elif os.path.lexists(file):
            yield file, f"{file}: is of no closed segment of this log."


def _problem(folder: Path, segment: Segment) -> str:
    """Return what is wrong with the tables of a segment; "": nothing, or it has none."""
    try:
        tables = events_about.SegmentTables.of(folder, segment)
        if tables is not None:
            tables.check()
    except errors.StaleIndexError as error:
        return str(error)
    return ""


def _folder_of(reader: LogReader) -> Path:
    given = reader.given
    if not isinstance(given, Path) or not given.is_dir():
        raise errors.LogAccessError(
            f"{reader.folder}: expected a log's folder on this machine, got something else; "
            "fetch or unpack it first."
        )
    return given / events_about.FOLDER


def _index(
    reader: LogReader,
    folder: Path,
    *,
    anew: bool,
    thorough: bool,
    progress: Progress | None,
    pause: Callable[[], None] | None,
) -> Indexed:
    done = Indexed()
    closed = _indexable(reader)
    done.segments = len(closed)
    done.removed = _tidied(folder, {s.path.stem for s in closed})
    total, at = sum(s.statistics.message_count for s in closed), 0
    for segment in closed:
        if segment.has_unknown_events:
            done.skipped.append(segment.path.name)
        elif anew or not _is_good(folder, segment, thorough=thorough):
            done.events += _make(folder, segment, pause)
            done.made.append(segment.path.name)
        at += segment.statistics.message_count
        if progress is not None:
            progress(at, total)
    good = {s.path.stem: s for s in closed if s.path.name not in done.skipped}
    done.size = sum(_size_of(file) for file in _files_in(folder) if _stem_of(file.name) in good)
    done.log_size = sum(s.size for s in good.values())
    return done


def _is_good(folder: Path, segment: Segment, *, thorough: bool) -> bool:
    """Return whether a segment has tables; `thorough`: whether each byte is as written."""
    try:
        tables = events_about.SegmentTables.of(folder, segment)
        if tables is not None:
            tables.check() if thorough else tables.check_ends()
    except errors.StaleIndexError:
        return False
    return tables is not None


def _make(folder: Path, segment: Segment, pause: Callable[[], None] | None) -> int:
    """Write the tables of a segment, and return how many events they have."""
    from semmap_log.core.arrow.history_table import RowsByDoor, commit_table
    from semmap_log.core.arrow.parquet import FEW_ROWS, write_groups

    rows, said = RowsByDoor(), NotesByCommit()
    count = 0
    for page, batch in batches_of(segment, np.arange(len(segment.chunks))):
        said.take(page)
        if len(batch):
            rows.add(batch, batch.door_ids())
        count += len(batch)
        if pause is not None:
            pause()
    if not count:
        return 0
    stem = segment.path.stem
    events_about.binding_path(folder, stem).unlink(missing_ok=True)
    commits = said.commits()
    numbers = segment.header.first_event + np.arange(count)
    events = rows.sorted(commits.notes_of(numbers).astype(np.int32), commits.texts)
    table = commit_table(commits)
    with _whole(events_about.part_path(folder, stem, events_about.EVENTS)) as temporary:
        tables, sample = events.tables(FEW_ROWS), events.sample(SAMPLED)
        write_groups(temporary, tables, sample, pause)
    with _whole(events_about.part_path(folder, stem, events_about.COMMITS)) as temporary:
        groups = (table.slice(at, FEW_ROWS) for at in range(0, len(table), FEW_ROWS))
        write_groups(temporary, groups, table.slice(0, SAMPLED), pause)
    with _whole(events_about.binding_path(folder, stem)) as temporary:
        temporary.write_text(events_about.tell(folder, stem, segment), "utf-8")
    return count


_OURS = late_pattern(
    rf"(?P<stem>.+_\d{{6,}})\.(?:json|(?:{'|'.join(events_about.PARTS)})\.parquet)"
    rf"(?P<is_left>\.\d+{re.escape(TEMPORARY_SUFFIX)})?",
    re.DOTALL,
)
"""The name of a file of tables, or of one that a killed process has left."""


def _stem_of(name: str) -> str:
    """Return the stem of the segment that a file is of; "": it is none of ours."""
    match = _OURS.fullmatch(name)
    return match["stem"] if match and not match["is_left"] else ""


def _tidied(folder: Path, stems: set[str]) -> list[str]:
    """Remove the files of no segment, and what a killed process has left; return their names."""
    removed = []
    for file in sorted(folder.iterdir()):
        if _OURS.fullmatch(file.name) and _stem_of(file.name) not in stems:
            file.unlink()
            removed.append(file.name)
    return removed


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """Hand out a name for a new file that takes its own in the end; what is half is removed.

    Nothing is synced: readers check it, and it can be made again.
    """
    temporary = path.with_name(f"{path.name}.{os.getpid()}{TEMPORARY_SUFFIX}")
    try:
        yield temporary
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the lock of a read model."""
    from semmap_log.store.folder import LogFolder
    from semmap_log.store.lock import WriterLock

    try:
        lock = WriterLock(LogFolder(folder))
    except errors.LogLockedError:
        raise errors.LogLockedError(
            f"{folder}: another process is making this index; it will be there soon."
        ) from None
    try:
        yield
    finally:
        lock.release()
