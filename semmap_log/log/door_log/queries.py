"""What a log offers as tables, for pandas, polars, DuckDB and whatever else reads Arrow.

Also what a time means that a caller gives, and which door a query is about: one that exists, or
one that ever did; the queries in other languages, of which an upper package answers `sql`; and the
parts of a log, with what their events have in common: so that a query reads few of them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np

from semmap_log.core.batches.event_batch import distinct
from semmap_log.core.folds import door_index
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.levels import NAME
from semmap_log.core.io.progress import Progress
from semmap_log.core.late_answers import answer_of
from semmap_log.core.model import events
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.moments import Time
from semmap_log.errors import UnknownDoorError
from semmap_log.log.replay.replay import Scope, replay
from semmap_log.store.pages import kinds_mask
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment, numbers_of
from semmap_log.store.reading.window import EVERYTHING, Window

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from semmap_log.core.arrow.arrow_sdk import DataFrame, PolarsFrame, pa
    from semmap_log.core.folds.history import HistoryEntry


def door_in(
    door: str | int, reader: LogReader, scope: Scope, door_map: DoorMap | None = None
) -> DoorId:
    """Return the door of that id, name, or level/name, as of a moment.

    Args:
        door: Id, name, or level/name.
        reader: Of the log.
        scope: The moment.
        door_map: The doors then, where they are known already.

    Raises:
        UnknownDoorError: None, more than one, or one that was removed by then.
    """
    state = None
    if door_map is None:
        state = replay(reader, scope)
        door_map = state.door_map()
    try:
        return door_index.resolve_door(door, door_map)
    except UnknownDoorError:
        state = replay(reader, scope) if state is None else state
        removed = door_index.removed_by_name(door, state)
        if not removed:
            raise
        raise UnknownDoorError(door_index.removal_message(removed, state)) from None


def door_or_removed(door: str | int, reader: LogReader) -> DoorId:
    """Return the door of that id, name, or level/name; one that was removed, or retracted, too.

    Raises:
        UnknownDoorError: There is no such door, and never was.
    """
    state = replay(reader, with_newer=True)
    try:
        return door_index.resolve_door(door, state.door_map())
    except UnknownDoorError:
        removed = door_index.removed_by_name(door, state)
        if len(removed) > 1:
            raise UnknownDoorError(door_index.ambiguous_removed(door, removed)) from None
        if removed:
            return removed[0]
        for ever in (state, _with_retracted(reader)):
            names = ever.names()
            for door_id in map(DoorId, sorted(ever.used_door_ids)):
                called = (str(door_id), f"{door_index.ID_PREFIX}{door_id}", names.get(door_id))
                if str(door) in called and not state.is_present(door_id):
                    return door_id
        raise


def ids_or_removed(doors: Iterable[DoorId | str], reader: LogReader) -> list[DoorId]:
    """Return the ids of doors; a name is looked up, those of doors that are gone, too.

    Args:
        doors: Ids, names, or level/names; one alone, too.
        reader: Of the log.

    Raises:
        UnknownDoorError: No door has such a name, or ever had.
    """
    return [
        DoorId(int(door))
        if not isinstance(door, str) and events.is_whole_number(door)
        else door_or_removed(door, reader)
        for door in door_index.doors_listed(doors)
    ]


def _with_retracted(reader: LogReader) -> DoorMapState:
    """Return all doors and names that ever were, as if nothing had been retracted."""
    state = DoorMapState()
    for batch in reader.batches(Window(kinds=kinds_mask([events.DoorAdded, events.DoorAnnotated]))):
        state.apply(batch)
    return state


def all_door_names(reader: LogReader) -> dict[DoorId, set[str]]:
    """Return all names that each door ever had, including names that were retracted.

    A door that was neither added nor named, as in what was recovered of a log, is not among them.
    """
    found: dict[DoorId, set[str]] = {}
    for batch in reader.batches(
        Window(kinds=kinds_mask([*events.ADDING_KINDS, events.DoorAnnotated]))
    ):
        for door_id in distinct(batch.door_ids()[batch.about_doors()]).tolist():
            found.setdefault(DoorId(door_id), set())
        for event in batch.objects.get(events.DoorAnnotated.kind, ()):
            if isinstance(event, events.DoorAnnotated) and event.key == NAME and event.value:
                found[event.door_id].add(event.value)
    return found


class EventChoice(TypedDict, total=False):
    """The keywords by which tables of events are chosen; `LogTables.tables` says what each is."""

    recorded: bool
    doors: Collection[DoorId | str] | None
    kinds: Collection[type[events.Event] | str] | None
    retracted: bool
    columns: Collection[str] | None
    progress: Progress | None


class LogTables(ABC):
    """A log as tables: one row an event, by event number, with who did it and why.

    Every kind's fields stand side by side, with the names of the door and of its level as they
    were then: the columns are those of an exported Parquet file. Texts that many rows share are
    dictionaries.
    """

    @property
    @abstractmethod
    def _reader(self) -> LogReader:
        """The bytes underneath."""

    @abstractmethod
    def window(
        self,
        since: Time = None,
        until: Time = None,
        *,
        recorded: bool = False,
        kinds: Collection[type[events.Event] | str] | None = None,
    ) -> Window:
        """Return the bounds that these moments mean."""

    def to_arrow(
        self, since: Time = None, until: Time = None, **choice: Unpack[EventChoice]
    ) -> pa.Table:
        """Return events as one pyarrow.Table; all of it lies in memory.

        Args:
            since: From then on (happened time).
            until: Before then.
            **choice: The keywords of `tables`: `columns` and the others.

        Raises:
            MissingExtraError: pyarrow is not installed.
        """
        from semmap_log.core.arrow.history_table import joined
        from semmap_log.log.door_log.arrow_tables import columns_called

        columns = columns_called(choice.get("columns"))
        return joined(self.tables(since, until, **choice), columns)

    def to_pandas(
        self, since: Time = None, until: Time = None, **choice: Unpack[EventChoice]
    ) -> DataFrame:
        """Return the same as a pandas.DataFrame: shared texts as categories, times in UTC.

        Args:
            since: From then on (happened time).
            until: Before then.
            **choice: The keywords of `tables`: `columns` and the others.

        Raises:
            MissingExtraError: pyarrow or pandas is not installed.
        """
        from semmap_log.core.arrow.arrow_sdk import frame_of

        return frame_of(self.to_arrow(since, until, **choice))

    def to_polars(
        self, since: Time = None, until: Time = None, **choice: Unpack[EventChoice]
    ) -> PolarsFrame:
        """Return the same as a polars.DataFrame.

        Args:
            since: From then on (happened time).
            until: Before then.
            **choice: The keywords of `tables`: `columns` and the others.

        Raises:
            MissingExtraError: pyarrow or polars is not installed.
        """
        from semmap_log.core.arrow.arrow_sdk import polars_frame_of

        return polars_frame_of(self.to_arrow(since, until, **choice))

    def tables(
        self,
        since: Time = None,
        until: Time = None,
        *,
        recorded: bool = False,
        doors: Collection[DoorId | str] | None = None,
        kinds: Collection[type[events.Event] | str] | None = None,
        retracted: bool = False,
        columns: Collection[str] | None = None,
        progress: Progress | None = None,
    ) -> Iterator[pa.Table]:
        """Yield the same in tables of about a MiB of the log: memory does not grow with the log.

        None of them is empty. Their dictionaries differ: `unify_dictionaries` of a joined table
        makes them one.

        Args:
            since: From then on (happened time).
            until: Before then.
            recorded: The range is of recorded time.
            doors: Only events about these doors: ids, names, or level/names.
            kinds: Only these kinds: classes, or their names.
            retracted: Retracted events, too; the column `retracted` marks them.
            columns: Only these, in this order; the others are not made. None: all.
            progress: Called with the progress of the reading.

        Raises:
            MissingExtraError: pyarrow is not installed.
            CommandError: There is no such column.
            UnknownDoorError: No door has such a name, or ever had.
        """
        from semmap_log.log.door_log.arrow_tables import columns_called, event_tables

        ids = None if doors is None else ids_or_removed(doors, self._reader)
        return event_tables(
            self._reader,
            self.window(since, until, recorded=recorded, kinds=kinds),
            columns_called(columns),
            doors=ids,
            retracted=retracted,
            progress=progress,
        )

    def tables_in(
        self,
        window: Window = EVERYTHING,
        *,
        columns: Collection[str] | None = None,
        limit: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[pa.Table]:
        """Yield the events of a window so, retracted ones included and marked.

        Args:
            window: Which events: see `window`; default: all.
            columns: Only these, in this order; None: all.
            limit: What was called how, and taken back, by the events up to this number; None: by
                all.
            progress: Called with the progress of the reading.
        """
        from semmap_log.log.door_log.arrow_tables import columns_called, event_tables

        chosen = columns_called(columns)
        return event_tables(self._reader, window, chosen, limit=limit, progress=progress)


class LogQueries(ABC):
    """A log as those see it who plan what to read of it."""

    @property
    @abstractmethod
    def _reader(self) -> LogReader:
        """The bytes underneath."""

    def sql(self, query: str, *, allow_files: bool = False, **others: Any) -> Any:
        """Return what a query in SQL answers, as a relation of DuckDB: `.df()`, `.pl()` and so on.

            log.sql("select door_name, count(*) from events group by all").df()

        The views are `events`, `changes`, `doors`, `intervals`, `commits`, `patrols` and `poses`;
        `doors_at('2h ago')`, `doors_known_at(…)` and `beliefs(…)` are of a moment. Rows are made
        when the relation is read; the log is queried as it was opened.

        Args:
            query: One SELECT.
            allow_files: It may read files, such as a CSV to join with.
            **others: More logs: `log.sql("… from east.events", east=other)`.

        Raises:
            SqlError: It is no question, or names what is not there.
            MissingExtraError: duckdb or pyarrow is not installed.
        """
        return answer_of("sql")(query, self, others, allow_files=allow_files)

    def parts(self) -> Iterator[LogPart]:
        """Yield the ranges of events that lie in one segment each."""
        return segment_parts(self._reader)

    def parts_within(self, part: LogPart) -> Iterator[LogPart]:
        """Yield the smaller ranges, of a chunk or a few, of one that `parts` gave."""
        return parts_of_segment(self._reader, part)

    def all_door_names(self) -> dict[DoorId, set[str]]:
        """Return all names that each door ever had; retracted ones, too."""
        return all_door_names(self._reader)

    def history_in(
        self, window: Window, doors: Collection[DoorId] | None = None
    ) -> Iterator[HistoryEntry]:
        """Yield the events of a window with who did it and why and what they changed.

        Args:
            window: Which events.
            doors: Only those about these; None: all.
        """
        from semmap_log.log.door_log.last_patrol import entries

        return entries(self._reader, window, doors, with_newer=False)

    def unordered_tables(
        self,
        windows: Sequence[Window],
        columns: Collection[str],
        doors: Collection[DoorId] | None = None,
    ) -> Iterator[pa.Table]:
        """Yield the events of windows as tables, retracted ones included, and perhaps others.

        They come in whatever order is quickest, those of closed segments from the read model.

        Args:
            windows: Ranges of event numbers, ascending and apart from each other.
            columns: Names of columns of `tables`.
            doors: Only events about these need be there; None: all.
        """
        from semmap_log.log.door_log.arrow_tables import columns_called, unordered_tables

        return unordered_tables(self._reader, windows, columns_called(columns), doors)


MOST_RUNS = 256
"""Parts of a segment: a live one has a chunk for every commit."""


class LogPart(NamedTuple):
    """A range of events; all bounds are inclusive, times nanoseconds UTC."""

    first_event: int
    last_event: int
    happened_ns: tuple[int, int]
    """When they happened, as far as that counts: never after recording."""
    recorded_ns: tuple[int, int]


def segment_parts(reader: LogReader) -> Iterator[LogPart]:
    """Yield the segments that have events.

    Raises:
        CorruptLogError: A summary is damaged.
    """
    for segment in reader.segments:
        first, end = segment.header.first_event, end_of(segment)
        if first < end:
            yield LogPart(first, end - 1, segment.span, segment.recorded)


def parts_of_segment(reader: LogReader, part: LogPart) -> Iterator[LogPart]:
    """Yield runs of chunks of the segment that is this part.

    Raises:
        CorruptLogError: Its index is damaged.
    """
    place = reader.segment_of(part.first_event)
    assert place is not None, "`segment_parts` gave it"
    yield from _runs(reader.segments[place])


def _runs(segment: Segment) -> Iterator[LogPart]:
    firsts, ends = numbers_of(segment)
    chunks = np.flatnonzero(segment.spans["events"])
    starts = distinct(np.linspace(0, len(chunks), MOST_RUNS, endpoint=False).astype(np.intp))
    spans, rows = segment.spans[chunks], segment.chunks.rows[chunks]
    columns = (
        np.minimum.reduceat(firsts[chunks], starts),
        np.maximum.reduceat(ends[chunks], starts),
        np.minimum.reduceat(spans["least"], starts),
        np.maximum.reduceat(spans["greatest"], starts),
        np.minimum.reduceat(rows["start_ns"], starts),
        np.maximum.reduceat(rows["end_ns"], starts),
    )
    for first, end, least, greatest, start, last in zip(
        *(c.tolist() for c in columns), strict=True
    ):
        yield LogPart(first, end - 1, (least, greatest), (start, last))
