"""The events about some doors: from the tables where there are any, else from the log.

Each segment can have tables on disk:

    index/office_000000.json            what they belong to; sealed, and written last
    index/office_000000.events.parquet  the events by door
    index/office_000000.commits.parquet who and why, by event number

The first file names the segment by log, first event and hashes, and the other two by checksums of
all their bytes (`arrow.sealed_parquet`). Tables that do not match are not used.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.disk import read_own
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazily import computed_once
from semmap_log.core.model.commits import NOTE_TEXTS, NoteTexts
from semmap_log.core.model.events import KINDS
from semmap_log.core.texts import counted
from semmap_log.errors import StaleIndexError
from semmap_log.store.closed_mark import sealed, unsealed
from semmap_log.store.reading.reader import LogReader, OnPage
from semmap_log.store.reading.segment_reading import CommitColumns, end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.core.arrow.arrow_sdk import pa
    from semmap_log.core.arrow.parquet import Seal, SealedParquet


FOLDER = "index"
"""In the log's folder."""
VERSION = 3
"""Incremented when the columns change: older tables are rebuilt."""
EVENTS, COMMITS = "events", "commits"
PARTS = (EVENTS, COMMITS)
_MOST_TOLD = 2**20
"""Bytes of a `.json` at most."""


@cache
def has_pyarrow() -> bool:
    """Return whether tables can be read and made here: whether pyarrow is installed."""
    return importlib.util.find_spec("pyarrow") is not None


def binding(segment: Segment) -> dict[str, Any]:
    """Return what identifies a closed segment's events: equal, whatever was compacted.

    Raises:
        CorruptLogError: Its summary is damaged.
    """
    return {
        "version": VERSION,
        "log_id": segment.header.info.log_id,
        "first_event": segment.header.first_event,
        "events": end_of(segment) - segment.header.first_event,
        "hash_before": segment.header.hash_so_far.hex(),
        "hash": segment.head.hex(),
    }


def part_path(folder: Path, stem: str, part: str) -> Path:
    """Return the file of a part of the tables of a segment."""
    return folder / f"{stem}.{part}.parquet"


def binding_path(folder: Path, stem: str) -> Path:
    """Return the file that says what tables are of."""
    return folder / f"{stem}.json"


def tell(folder: Path, stem: str, segment: Segment) -> str:
    """Return the text of the file that makes the parts, which lie there, count.

    Raises:
        OSError: They cannot be read.
    """
    from semmap_log.core.arrow.parquet import seal_of

    files = {part: seal_of(part_path(folder, stem, part)) for part in PARTS}
    return sealed({**binding(segment), "files": files})


@dataclass(frozen=True)
class SegmentTables:
    """The tables of a segment: what they must be was read, they themselves are not yet."""

    folder: Path
    stem: str
    numbers: range
    """Of the segment's events."""
    seals: Mapping[str, Seal]
    """Part -> what its bytes must be."""

    @classmethod
    def of(cls, folder: Path, segment: Segment) -> SegmentTables | None:
        """Return the tables of a closed segment, or None if it has none.

        Raises:
            StaleIndexError: They belong to something else, or it is not known to what.
        """
        path, wanted = binding_path(folder, segment.path.stem), binding(segment)
        try:
            told = unsealed(json.loads(read_own(path, _MOST_TOLD)))
            seals = {part: told["files"][part] for part in PARTS}
        except FileNotFoundError:
            return None
        except OSError as error:
            raise StaleIndexError(f"{path}: cannot be read: {error.strerror or error}.") from None
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise StaleIndexError(f"{path}: is damaged: {error}") from None
        for name, value in wanted.items():
            if told.get(name) != value:
                got = f"{name} {told.get(name)}, expected {value}"
                raise StaleIndexError(
                    f"{path}: is of another segment, or an older state of it: {got}."
                )
        first = int(wanted["first_event"])
        return cls(folder, segment.path.stem, range(first, first + wanted["events"]), seals)

    def about(self, doors: Collection[int]) -> EventBatch:
        """Return all events about some doors, in the order of their numbers.

        Raises:
            StaleIndexError: They are not what was written.
        """
        from semmap_log.core.arrow.history_table import columns_of_events, events_in

        with self._opened(EVENTS) as file:
            rows = _rows_of(file, doors, [*columns_of_events(file.names), "source"])
            fields = events_in(rows)
            self._check_numbers(fields["number"])
            return EventBatch(**fields, sources_of=_Sources(rows, fields["number"]))

    def all_rows(self, names: Collection[str]) -> pa.Table:
        """Return some columns of all rows, by door; those that no event fills are left out.

        Raises:
            StaleIndexError: They are not what was written.
        """
        with self._opened(EVENTS) as file:
            return file.all([name for name in file.names if name in names])

    @computed_once
    def commits(self) -> CommitColumns:
        """Who and why of all its events.

        Raises:
            StaleIndexError: They are not what was written.
        """
        with self._opened(COMMITS) as file:
            if file.rows > len(self.numbers):  # each has at least one event
                raise ValueError(f"{counted(file.rows, 'commit')} of {len(self.numbers)} events")
            return _commits_of(file.all(), self.numbers)

    def check(self) -> None:
        """Read every byte of it.

        Raises:
            StaleIndexError: They are not what was written.
        """
        for part in PARTS:
            with self._opened(part) as file:
                file.check()

    def check_ends(self) -> None:
        """Look whether the files are there, as long as they were, and end as they did.

        Raises:
            StaleIndexError: They are, or do, not.
        """
        for part in PARTS:
            with self._opened(part):
                pass

    def _check_count(self, rows: int) -> None:
        if rows != len(self.numbers):
            raise ValueError(f"expected {counted(len(self.numbers), 'event')}, got {rows}")

    def _check_numbers(self, found: NDArray[np.int64]) -> None:
        if len(found) and not (int(found[0]) in self.numbers and int(found[-1]) in self.numbers):
            raise ValueError("events of another segment")
        if not (np.diff(found) > 0).all():
            raise ValueError("an event is there twice")

    @contextmanager
    def _opened(self, part: str) -> Iterator[SealedParquet]:
        """Hand out a table; whatever goes wrong with it, it is no table.

        Raises:
            StaleIndexError: It cannot be read, or is not what was written.
        """
        from semmap_log.core.arrow.parquet import SealedParquet

        path = part_path(self.folder, self.stem, part)
        try:
            with SealedParquet(path, self.seals[part]) as file:
                if part == EVENTS:
                    self._check_count(file.rows)
                yield file
        except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
            raise StaleIndexError(f"{path}: is not what was written: {error}.") from None


def _rows_of(file: SealedParquet, doors: Collection[int], names: Sequence[str]) -> pa.Table:
    """Return the rows of some doors, unsorted; groups that cannot hold any are not read."""
    from semmap_log.core.arrow.arrow_sdk import pa

    wanted = np.array(sorted(doors), np.int64)
    first, last = np.array(file.spans("door_id"), np.int64).reshape(-1, 2).T
    begin = np.searchsorted(wanted, first)
    may_hold = begin < np.searchsorted(wanted, last, "right")
    parts = []
    for group in np.flatnonzero(may_hold).tolist():
        rows = file.group(group, names)
        ids = rows["door_id"]
        inside = np.isin(ids.fill_null(0).to_numpy(), wanted)
        inside &= ids.is_valid().to_numpy() if ids.null_count else True
        places = np.flatnonzero(inside)
        if len(places) and places[-1] - places[0] + 1 == len(places):
            parts.append(rows.slice(int(places[0]), len(places)))
        else:
            parts.append(rows.take(pa.array(places)))
    if not parts:
        return file.nothing(names)
    return pa.concat_tables(parts).unify_dictionaries().combine_chunks()


def _commits_of(rows: pa.Table, numbers: range) -> CommitColumns:
    """Return the commits of some events.

    Raises:
        ValueError: They are not the commits of these events.
        KeyError: A column is missing.
    """
    firsts, counts = rows["first_event"].to_numpy(), rows["count"].to_numpy()
    ends = np.append(numbers.start, firsts + counts)
    if not np.array_equal(ends, np.append(firsts, numbers.stop)):
        raise ValueError("commits of other events")
    notes, texts = np.zeros(len(firsts), np.intp), [()]
    for name in NOTE_TEXTS:
        codes, said = _coded(rows[name])
        different, notes = np.unique(notes * len(said) + codes, return_inverse=True)
        texts = [(*texts[d // len(said)], said[d % len(said)]) for d in different.tolist()]
    ids = b"".join(rows["command_id"].to_pylist())
    command_id = np.frombuffer(ids, np.uint8).reshape(-1, 16)
    return CommitColumns(firsts, counts, command_id, notes, cast("list[NoteTexts]", texts))


def _coded(column: pa.ChunkedArray) -> tuple[NDArray[np.intp], list[str]]:
    """Return the place of each text among the different ones, and these; one that is null is ""."""
    joined = column.combine_chunks()
    if hasattr(joined, "combine_chunks"):
        joined = joined.combine_chunks()
    codes = joined.indices.fill_null(-1).to_numpy(zero_copy_only=False).astype(np.intp) + 1
    return codes, ["", *joined.dictionary.to_pylist()]


class _Sources:
    """Looks up where the events of some rows are from: see `EventBatch.sources_of`."""

    def __init__(self, rows: pa.Table, numbers: NDArray[np.int64]) -> None:
        """Take the rows, and their event numbers, sorted."""
        codes, self._names = _coded(rows["source"])
        order = np.argsort(rows["event"].to_numpy(), kind="stable")
        self._codes, self._numbers = codes[order], numbers

    def __call__(self, numbers: NDArray[np.int64]) -> tuple[NDArray[np.intp], Sequence[str]]:
        return self._codes[np.searchsorted(self._numbers, numbers)], self._names


FEW_CHUNKS = 2
"""So few of a segment are read from the log sooner than a table is opened."""

OnRows = Callable[[Segment, SegmentTables, EventBatch], None]
"""Called with all rows about the doors in a segment, before the window is applied."""


def about(
    batch: EventBatch, doors: Collection[int] | None, *, with_newer: bool = False
) -> EventBatch:
    """Return the events of a batch that are about some doors; None: all.

    Args:
        batch: The events.
        doors: The doors.
        with_newer: And those of kinds unknown here, which may be about any.
    """
    if doors is None:
        return batch
    chosen = batch.of_doors(doors)
    if with_newer:
        chosen |= batch.kind > len(KINDS)
    return batch.select(chosen)


def events_about(
    reader: LogReader,
    window: Window,
    doors: Collection[int] | None,
    *,
    with_newer: bool = False,
    progress: Progress | None = None,
    on_page: OnPage | None = None,
    on_rows: OnRows | None = None,
) -> Iterator[EventBatch]:
    """Yield the events of a window about some doors, numbers ascending, retracted ones included.

    Args:
        reader: Of the log.
        window: Which events.
        doors: The doors; None: all events, which the log itself gives faster.
        with_newer: Yield events of unknown kinds, too, which may be about any door.
        progress: Called with the progress of the reading.
        on_page: Called with the records of each batch that comes from the log.
        on_rows: Called with what comes from a table.

    Raises:
        CorruptLogError: A chunk is not what was written, or events are missing.
    """
    reader.check_horizon(window)
    tables = {} if doors is None else _tables(reader, window)

    def read(first: int, before: int | None = None) -> Iterator[EventBatch]:
        """Yield what the log itself has, from an event on, before another."""
        part = _cut(window, first, before)
        if part is None:
            return
        found = reader.batches(
            part,
            doors=doors,
            progress=progress,
            on_page=on_page,
            with_newer=with_newer,
            is_part=True,
        )
        for batch in found:
            chosen = about(batch, doors, with_newer=with_newer)
            if len(chosen):
                yield chosen

    at = 0
    for segment in reader.segments if tables else ():
        found = tables.get(segment.header.first_event)
        if found is None:
            continue
        rows = _rows(found, doors or (), with_commits=on_rows is not None)
        if rows is None:
            continue
        yield from read(at, segment.header.first_event)
        at = end_of(segment)
        chosen = window.choose(rows)
        if len(chosen):
            if on_rows is not None:
                on_rows(segment, found, rows)
            yield chosen
    yield from read(at)


def _cut(window: Window, first: int, before: int | None) -> Window | None:
    """Return the part of a window from an event on, before another, or None."""
    least = max(first, window.first_event or 0)
    bounds = [bound for bound in (before, window.before_event) if bound is not None]
    behind = min(bounds, default=None)
    if behind is not None and behind <= least:
        return None
    if not first and before is None:
        return window
    return replace(window, first_event=least, before_event=behind)


def _tables(reader: LogReader, window: Window) -> dict[int, SegmentTables]:
    """Return the tables that are worth asking, by the first events of their segments."""
    if not has_tables(reader):
        return {}
    found = {}
    for place, segment in enumerate(reader.segments):
        behind = reader.segments[place + 1 : place + 2]
        next_event = behind[0].header.first_event if behind else None
        is_closed = segment.closed and segment.told is None
        if not (is_closed and window.may_reach(segment, next_event)):
            continue
        if len(window.chunks(segment)) > FEW_CHUNKS and (tables := tables_of(reader, segment)):
            found[segment.header.first_event] = tables
    return found


def has_tables(reader: LogReader) -> bool:
    """Return whether a log may have tables, and pyarrow is installed to read them."""
    folder = reader.given / FOLDER
    return isinstance(folder, Path) and folder.is_dir() and has_pyarrow()


def tables_of(reader: LogReader, segment: Segment) -> SegmentTables | None:
    """Return the tables of a segment; None: it has none that can be used."""
    folder = reader.given / FOLDER
    is_whole = segment.closed and segment.told is None and segment.header.trimmed is None
    if not is_whole or segment.has_unknown_events:
        return None
    assert isinstance(folder, Path), "`has_tables` said so"
    try:
        return SegmentTables.of(folder, segment)
    except StaleIndexError as error:
        not_used(error)
        return None


def _rows(
    tables: SegmentTables, doors: Collection[int], *, with_commits: bool
) -> EventBatch | None:
    try:
        if with_commits:
            tables.commits  # noqa: B018 - read now: a damaged one is not used
        return tables.about(doors)
    except StaleIndexError as error:
        not_used(error)
        return None


def not_used(error: StaleIndexError) -> None:
    """Log that a table is not used."""
    import logging

    logging.getLogger("semmap_log").info("%s It is not used; the log itself is read.", error)
