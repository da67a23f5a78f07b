"""What a log tells as tables, for pandas, polars, DuckDB and whatever else reads Arrow."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Final, TypedDict

from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import Event
from semmap_log.core.model.keywords import knows_its_keywords, share_keywords
from semmap_log.log.door_log.times import Time
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import EVERYTHING, Window

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from semmap_log.core.arrow.arrow_sdk import DataFrame, PolarsFrame, pa


class EventChoice(TypedDict, total=False):
    """The keywords by which tables of events are chosen; `LogTables.tables` says what each is."""

    recorded: bool
    doors: Collection[DoorId | str] | None
    kinds: Collection[type[Event] | str] | None
    retracted: bool
    columns: Collection[str] | None
    progress: Progress | None


_USUAL: Final[EventChoice] = {
    "recorded": False,
    "doors": None,
    "kinds": None,
    "retracted": False,
    "columns": None,
    "progress": None,
}
share_keywords(EventChoice, _USUAL)


@knows_its_keywords
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
        kinds: Collection[type[Event] | str] | None = None,
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
        from semmap_log.log.door_log.asked_tables import columns_called

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
        kinds: Collection[type[Event] | str] | None = None,
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
            retracted: Retracted events, too; the column `retracted` tells them.
            columns: Only these, in this order; the others are not made. None: all.
            progress: Told how far the reading is.

        Raises:
            MissingExtraError: pyarrow is not installed.
            CommandError: There is no such column.
            UnknownDoorError: No door has such a name, or ever had.
        """
        from semmap_log.log.door_log.asked_doors import ids_ever
        from semmap_log.log.door_log.asked_tables import columns_called, event_tables

        ids = None if doors is None else ids_ever(doors, self._reader)
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
            progress: Told how far the reading is.
        """
        from semmap_log.log.door_log.asked_tables import columns_called, event_tables

        chosen = columns_called(columns)
        return event_tables(self._reader, window, chosen, limit=limit, progress=progress)
