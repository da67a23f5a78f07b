"""What queries in other languages ask of a log; and `sql`, which a room above answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from semmap_log.core.lazy.late_answers import answer_of
from semmap_log.core.model.doors import DoorId
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.core.arrow.arrow_sdk import pa
    from semmap_log.core.folds.history import HistoryEntry
    from semmap_log.log.door_log.log_parts import LogPart


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
        when the relation is read; the log is asked as it was opened.

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
        from semmap_log.log.door_log.log_parts import segment_parts

        return segment_parts(self._reader)

    def parts_within(self, part: LogPart) -> Iterator[LogPart]:
        """Yield the smaller ranges, of a chunk or a few, of one that `parts` gave."""
        from semmap_log.log.door_log.log_parts import parts_of_segment

        return parts_of_segment(self._reader, part)

    def names_ever(self) -> dict[DoorId, set[str]]:
        """Return all names that each door ever had; retracted ones, too."""
        from semmap_log.log.door_log.asked_doors import names_ever

        return names_ever(self._reader)

    def history_in(
        self, window: Window, doors: Collection[DoorId] | None = None
    ) -> Iterator[HistoryEntry]:
        """Yield the events of a window with who did it and why and what they changed.

        Args:
            window: Which events.
            doors: Only those about these; None: all.
        """
        from semmap_log.log.door_log.asked_events import entries

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
        from semmap_log.log.door_log.asked_tables import columns_called
        from semmap_log.log.door_log.unordered_tables import unordered_tables

        return unordered_tables(self._reader, windows, columns_called(columns), doors)
