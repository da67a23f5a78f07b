"""Which logs are meant: paths and URLs, folders of logs, patterns, and files that list them.

It also holds the job that exports events to a lake: Parquet files, a folder a month, a file a log.
Folders are named as by Hive: DuckDB, Spark, polars and pandas read OUT as one table with a column
`month`, of the time when an event happened (UTC). `happened_ns` and `recorded_ns` are whole
nanoseconds, which some tables' own times are not. A file is written once, and named by its content.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from fnmatch import fnmatchcase
from pathlib import Path, PurePath
from typing import ClassVar

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.errors import FormatError, NotALogError
from semmap_log.fleet.jobs import lake_folder
from semmap_log.fleet.jobs.job import Holds, Told
from semmap_log.log import DoorLog, Window

MARKS = "*?["
"""Marks of a pattern, in any part of a path or URL; each matches within one part."""


def log_places(named: Iterable[str | PurePath]) -> list[str]:
    """Return the logs that are meant, each once, in the order in which they are named.

    Args:
        named: Each a log; a folder or prefix with logs right below it; either with `*`, `?` or
            `[…]`; or `@FILE` with one such a line (`#` begins a comment).

    Raises:
        NotALogError: One of them matches no log, or is no place.
        FormatError: A list cannot be read.
        LogAccessError: The store or the disk denies access.
        MissingExtraError: obstore is not installed.
    """
    found: dict[str, None] = {}
    for text in _lines(named):
        places = list(_meant(text))
        if not places:
            raise NotALogError(f"{text}: expected logs, found none there.")
        found |= dict.fromkeys(str(place) for place in places)
    if not found:
        raise NotALogError("expected at least one log, or a place with logs below it.")
    return list(found)


def _lines(named: Iterable[str | PurePath]) -> Iterator[str]:
    for each in map(str, named):
        if not each.startswith("@"):
            yield each
            continue
        path = Path(each[1:])
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise FormatError(path, f"expected a list of logs, a line each: {error}.") from None
        yield from (line.strip() for line in lines if line.strip()[:1] not in ("", "#"))


def _meant(text: str) -> Iterator[Path | UrlPath]:
    place = place_of(text)
    if any(mark in str(place) for mark in MARKS) and not _is_there(place):
        yield from _matching(place)
        return
    is_log, below = _look(place)
    # An empty place raises its own error when it is opened.
    yield from (place / name for name in below) if below and not is_log else (place,)


def _is_there(place: PurePath) -> bool:
    return isinstance(place, Path) and place.exists()


def _matching(pattern: Path | UrlPath) -> Iterator[Path | UrlPath]:
    """Yield the places that match a pattern, part by part."""
    parts = pattern.parts
    first = next(i for i, part in enumerate(parts) if any(mark in part for mark in MARKS))
    root = type(pattern)(*parts[:first])
    found: list[Path | UrlPath] = [root]
    for part in parts[first:]:
        is_plain = not any(mark in part for mark in MARKS)
        found = [
            place / name
            for place in found
            for name in ([part] if is_plain else _names(place))
            if is_plain or fnmatchcase(name, part)
        ]
    yield from found


def _look(place: Path | UrlPath) -> tuple[bool, Sequence[str]]:
    """Return whether a log lies right there, and name the folders in which others may.

    On a web server the log is assumed to be there.
    """
    if isinstance(place, Path):
        if not place.is_dir() or _has_segments(place):
            return True, []
        return False, [name for name in _names(place) if _has_segments(place / name)]
    if place.scheme in ("http", "https"):
        return True, []
    objects, folders = ObjectStore(place).list_all()
    return any(each.name.endswith(".mcap") for each in objects), folders


def _has_segments(path: Path) -> bool:
    return path.is_dir() and any(path.glob("*.mcap"))


def _names(place: Path | UrlPath) -> Sequence[str]:
    """Return what a pattern can match: folders; on a disk also joins."""
    if isinstance(place, UrlPath):
        return ObjectStore(place).list_all()[1]
    if not place.is_dir():
        return []
    return sorted(
        each.name for each in place.iterdir() if each.is_dir() or each.name.endswith(".join.json")
    )


HEAD_DIGITS = 12


@dataclass(frozen=True, slots=True)
class MonthExport:
    """Every event of each log, retracted ones marked, with who and why."""

    out: str
    """A folder that each worker sees, absolute, or a URL."""

    name: ClassVar[str] = "export"
    holds: ClassVar[Holds] = Holds.never
    fields: ClassVar[tuple[pa.Field, ...]] = lake_folder.LAKE_FILE_FIELDS

    def parameters(self) -> str:
        """Return where to."""
        return self.out

    def ask(self, log: DoorLog) -> Told:
        """Write the missing files; return a row a file."""
        last = log.find_commit(log.last_event())
        if last is None:
            return Told({each.name: [] for each in self.fields})
        name = f"{log.info.log_id}-{last.hash.hex()[:HEAD_DIGITS]}.parquet"
        tables = _MonthTables(log)
        found: list[tuple[str, str, int, int]] = []
        for month in _months_of(log):
            events, size = lake_folder.LakeFolder(self.out, month).put(name, tables.of(month))
            if events:
                found.append((month, name, events, size))
        columns = map(list, zip(*found, strict=True))
        return Told({each.name: c for each, c in zip(self.fields, columns, strict=True)})


class _MonthTables:
    """The tables of a log's months, as the log is at the first."""

    def __init__(self, log: DoorLog) -> None:
        self._log = log
        self._limit = log.last_event()

    def of(self, month: str) -> Iterator[pa.Table]:
        """Yield the events that happened in a month, numbers ascending."""
        since_ns, until_ns = _bounds_of(month)
        window = Window(
            happened_from_ns=since_ns,
            happened_before_ns=until_ns,
            before_event=self._limit + 1,
            only_kept=True,
        )
        names = [column.name for column in lake_folder.EVENT_COLUMNS]
        for table in self._log.tables_in(window, columns=names, limit=self._limit):
            yield _as_lake(table, self._log.info.log_id)


def _as_lake(table: pa.Table, log_id: str) -> pa.Table:
    columns = [pa.array([log_id] * table.num_rows, pa.string()), *table.columns]
    return pa.Table.from_arrays(
        [
            column.cast(field.type)
            for column, field in zip(columns, lake_folder.LAKE_SCHEMA, strict=True)
        ],
        schema=lake_folder.LAKE_SCHEMA,
    )


def _months_of(log: DoorLog) -> Iterator[str]:
    """Yield the months from a log's first event to its last, earliest first."""
    span = log.happened_span()
    if span is None:
        return
    month, last = (_month_of(time_ns) for time_ns in span)
    while month <= last:
        yield month
        month = _month_of(_bounds_of(month)[1])


def _month_of(time_ns: int) -> str:
    return datetime.fromtimestamp(time_ns // 10**9, timezone.utc).strftime("%Y-%m")


def _bounds_of(month: str) -> tuple[int, int]:
    year, number = map(int, month.split("-"))
    following = (year + number // 12, number % 12 + 1)
    since, until = (datetime(*each, 1, tzinfo=timezone.utc) for each in ((year, number), following))
    return int(since.timestamp()) * 10**9, int(until.timestamp()) * 10**9
