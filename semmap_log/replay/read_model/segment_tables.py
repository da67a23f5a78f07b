"""The tables of one segment on the disk: what they are of, whether they are whole, their rows.

    index/office_000000.json            what it is of; sealed, and written last
    index/office_000000.events.parquet  the events by door
    index/office_000000.commits.parquet who and why, by event number

The first names the segment by log, first event and hashes, and the other two by their size and the
digest of their footers; their pages have checksums of their own. What does not fit is not used.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.batches.event_batch import EventBatch
from semmap_log.common.lazily import computed_once
from semmap_log.domain.commits import NOTE_TEXTS, Note
from semmap_log.errors import StaleIndexError
from semmap_log.store.reading.note_sources import CommitColumns, NoteTexts
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.sealed_json import sealed, unsealed

if TYPE_CHECKING:
    from semmap_log.arrow.arrow_sdk import pa

FOLDER = "index"
"""In the log's folder."""
VERSION = 2
"""Counts up when the columns change: older tables are made anew."""
EVENTS, COMMITS = "events", "commits"
PARTS = (EVENTS, COMMITS)
_MOST_TOLD = 2**16
"""Bytes of a `.json` at most."""


@cache
def has_pyarrow() -> bool:
    """Tell whether tables can be read and made here."""
    return importlib.util.find_spec("pyarrow") is not None


def binding(segment: Segment) -> dict[str, Any]:
    """Return what tells a closed segment's events from all others: equal, whatever was compacted.

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


def told_path(folder: Path, stem: str) -> Path:
    """Return the file that says what tables are of."""
    return folder / f"{stem}.json"


def tell(folder: Path, stem: str, segment: Segment) -> str:
    """Return the text of the file that makes the parts, which lie there, count.

    Raises:
        OSError: They cannot be read.
    """
    files = {part: _seal(part_path(folder, stem, part)) for part in PARTS}
    return sealed({**binding(segment), "files": files})


def _seal(path: Path) -> dict[str, Any]:
    """Return the size of a Parquet file, and the digest of its footer."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - 8))
        end = file.read()
        file.seek(max(0, size - 8 - int.from_bytes(end[:4], "little")))
        return {"size": size, "footer": hashlib.sha256(file.read()).hexdigest()}


class SaidOfCommit(NamedTuple):
    """Who did it and why, as far as histories tell."""

    note: Note
    command_id: bytes


@dataclass(frozen=True)
class SegmentTables:
    """The tables of a segment; that they are whole was seen but for their pages."""

    folder: Path
    stem: str

    @classmethod
    def of(cls, folder: Path, segment: Segment) -> SegmentTables | None:
        """Return those of a closed segment; None: it has none.

        Raises:
            StaleIndexError: They are of something else, half, or damaged; it says what.
        """
        stem = segment.path.stem
        path = told_path(folder, stem)
        try:
            with path.open("rb") as file:
                text = file.read(_MOST_TOLD)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise StaleIndexError(f"{path}: cannot be read: {error.strerror}.") from None
        _check_told(path, text, binding(segment), folder, stem)
        return cls(folder, stem)

    def about(self, doors: Collection[int]) -> EventBatch:
        """Return all events about some doors, in the order of their numbers.

        Raises:
            StaleIndexError: A page is not what was written.
        """
        from semmap_log.arrow.rows_by_door import columns_of_events, events_in

        with self._reading(EVENTS):
            names = [*columns_of_events(self._events.schema_arrow.names), "source"]
            rows = self._rows_of(doors, names)
        fields = events_in(rows)
        return EventBatch(**fields, sources_of=_Sources(rows, fields["number"]))

    def all_rows(self, names: Collection[str]) -> pa.Table:
        """Return some columns of all rows, by door; those that no event fills are left out.

        Raises:
            StaleIndexError: A page is not what was written.
        """
        with self._reading(EVENTS):
            there = [name for name in self._events.schema_arrow.names if name in names]
            return self._events.read(columns=there, use_threads=False)

    @computed_once
    def commits(self) -> CommitTable:
        """Who and why of all its events.

        Raises:
            StaleIndexError: A page is not what was written.
        """
        with self._reading(COMMITS):
            return CommitTable(self._open(COMMITS).read(use_threads=False))

    def check(self) -> None:
        """Read all of it.

        Raises:
            StaleIndexError: A page is not what was written.
        """
        for part in PARTS:
            with self._reading(part):
                file = self._open(part)
                for group in range(file.num_row_groups):
                    file.read_row_group(group, use_threads=False)

    def _rows_of(self, doors: Collection[int], names: Sequence[str]) -> pa.Table:
        """Return the rows of some doors, unsorted; groups that cannot hold any are not read."""
        from semmap_log.arrow.arrow_sdk import pa

        wanted = np.array(sorted(doors), np.int64)
        first, last = self._spans
        begin = np.searchsorted(wanted, first)
        may_hold = begin < np.searchsorted(wanted, last, "right")
        parts = []
        for group in np.flatnonzero(may_hold).tolist():
            rows = self._events.read_row_group(group, columns=names, use_threads=False)
            ids = rows["door_id"]
            inside = np.isin(ids.fill_null(0).to_numpy(), wanted)
            inside &= ids.is_valid().to_numpy() if ids.null_count else True
            places = np.flatnonzero(inside)
            if len(places) and places[-1] - places[0] + 1 == len(places):
                parts.append(rows.slice(int(places[0]), len(places)))
            else:
                parts.append(rows.take(pa.array(places)))
        if not parts:
            return self._events.schema_arrow.empty_table().select(names)
        return pa.concat_tables(parts).unify_dictionaries().combine_chunks()

    @computed_once
    def _events(self) -> Any:
        return self._open(EVENTS)

    @computed_once
    def _spans(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The least and the greatest door of each row group; (1, 0): it has none."""
        known = self._events.metadata
        place = self._events.schema_arrow.names.index("door_id")
        found = []
        for group in range(known.num_row_groups):
            said = known.row_group(group).column(place).statistics
            has = said is not None and said.has_min_max
            found.append((said.min, said.max) if has else (1, 0))
        first, last = np.array(found, np.int64).reshape(-1, 2).T
        return first, last

    def _open(self, part: str) -> Any:
        from semmap_log.arrow.parquet import open_checked

        return open_checked(part_path(self.folder, self.stem, part))

    def _reading(self, part: str) -> _Reading:
        return _Reading(part_path(self.folder, self.stem, part))


class _Reading:
    """Says of whatever goes wrong in reading a table that the table is none."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        # pyarrow says OSError, ArrowInvalid (a ValueError) or a KeyError of bytes that are wrong
        if isinstance(error, OSError | ValueError | KeyError | IndexError):
            raise StaleIndexError(f"{self._path}: is damaged: {error}") from None


def _check_told(
    path: Path, text: bytes, wanted: Mapping[str, Any], folder: Path, stem: str
) -> None:
    """Check what a `.json` says of a segment's tables, and the ends of the tables.

    Raises:
        StaleIndexError: They are of something else, half, or damaged.
    """
    try:
        told = unsealed(json.loads(text))
        files = told.pop("files")
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise StaleIndexError(f"{path}: is damaged: {error}") from None
    for name, value in wanted.items():
        if told.get(name) != value:
            got = f"{name} {told.get(name)}, expected {value}"
            raise StaleIndexError(f"{path}: is of another segment, or an older state of it: {got}.")
    for part in PARTS:
        file = part_path(folder, stem, part)
        try:
            if _seal(file) != files[part]:
                raise StaleIndexError(f"{file}: is not what was written.")
        except OSError as error:
            raise StaleIndexError(f"{file}: cannot be read: {error.strerror}.") from None


class CommitTable:
    """The commits of a segment, as far as histories tell."""

    def __init__(self, rows: pa.Table) -> None:
        """Take the rows.

        Raises:
            KeyError: A column is missing.
        """
        self._firsts = rows["first_event"].to_numpy()
        self._counts = rows["count"].to_numpy()
        self._rows = rows.select(["command_id", *NOTE_TEXTS])

    @computed_once
    def columns(self) -> CommitColumns:
        """The same as columns."""
        ids, *texts = (column.to_pylist() for column in self._rows.columns)
        known: dict[NoteTexts, int] = {}
        notes = [
            known.setdefault(
                (actor or "", source or "", reason or "", correlation or ""), len(known)
            )
            for actor, source, reason, correlation in zip(*texts, strict=True)
        ]
        command_id = np.frombuffer(b"".join(ids), np.uint8).reshape(-1, 16)
        places = np.array(notes, np.intp)
        return CommitColumns(self._firsts, self._counts, command_id, places, list(known))

    def said_of(self, numbers: NDArray[np.int64]) -> dict[int, SaidOfCommit]:
        """Return what is said of some of the segment's events, by their numbers, ascending."""
        places = np.searchsorted(self._firsts, numbers, "right") - 1
        chosen, codes = np.unique(places, return_inverse=True)
        notes: dict[tuple[str | None, ...], Note] = {}
        found = []
        columns = [column.to_pylist() for column in self._rows.take(chosen).columns]
        for command_id, *texts in zip(*columns, strict=True):
            note = notes.get(tuple(texts))
            if note is None:
                actor, source, reason, correlation = (text or "" for text in texts)
                note = notes[tuple(texts)] = Note(actor, source, reason, correlation)
            found.append(SaidOfCommit(note, command_id))
        return {n: found[code] for n, code in zip(numbers.tolist(), codes.tolist(), strict=True)}


class _Sources:
    """Looks up where the events of some rows are from: see `EventBatch.sources_of`."""

    def __init__(self, rows: pa.Table, numbers: NDArray[np.int64]) -> None:
        """Take the rows, and their event numbers, sorted."""
        self._rows, self._numbers = rows, numbers

    def __call__(self, numbers: NDArray[np.int64]) -> tuple[NDArray[np.intp], Sequence[str]]:
        codes, names = self._all
        return codes[np.searchsorted(self._numbers, numbers)], names

    @computed_once
    def _all(self) -> tuple[NDArray[np.intp], Sequence[str]]:
        column = self._rows["source"].combine_chunks()
        if hasattr(column, "combine_chunks"):
            column = column.combine_chunks()
        names = ["", *column.dictionary.to_pylist()]
        codes = column.indices.fill_null(-1).to_numpy(zero_copy_only=False).astype(np.intp) + 1
        order = np.argsort(self._rows["event"].to_numpy(), kind="stable")
        return codes[order], names
