"""Events with who did it and why: the table of an exported file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.arrow.arrow_sdk import pa
from semmap_log.arrow.schema import schema_of
from semmap_log.arrow.table import Events, table_of
from semmap_log.arrow.table_columns import COLUMNS, SAID
from semmap_log.domain.commits import Commit

HISTORY_SCHEMA = schema_of((*COLUMNS, *SAID))


class HistoryTables:
    """Joins batches with the commits that wrote them; both come in the order of event numbers."""

    def __init__(self, commits: Iterable[Commit]) -> None:
        self._following = iter(commits)
        self._commits: list[Commit] = []
        """Those of the last batch, the last of which may go on in the next."""

    def table(self, events: Events, retracted: NDArray[np.bool_]) -> pa.Table:
        """Return the table of a batch, by `HISTORY_SCHEMA`.

        Args:
            events: At least one.
            retracted: Which of them were taken back.
        """
        self._read_on(int(events.number[0]), int(events.number[-1]))
        ends = np.array([commit.last_event for commit in self._commits])
        place = pa.array(np.searchsorted(ends, events.number))
        said = [_texts(texts).take(place) for texts in zip(*map(_said, self._commits), strict=True)]
        columns = [*table_of(events).columns, *said, pa.array(retracted)]
        return pa.Table.from_arrays(columns, schema=HISTORY_SCHEMA)

    def _read_on(self, first: int, last: int) -> None:
        """Hold the commits of the events from `first` to `last`, and no others."""
        self._commits = [commit for commit in self._commits if commit.last_event >= first]
        while not (self._commits and self._commits[-1].last_event >= last):
            commit = next(self._following, None)
            assert commit is not None, "every event belongs to a commit"
            if commit.last_event >= first:
                self._commits.append(commit)


def _said(commit: Commit) -> tuple[str, ...]:
    note = commit.note
    return note.actor, note.source, note.reason, note.correlation, commit.command_id.hex()


def _texts(texts: Sequence[str]) -> pa.Array:
    return pa.array([text or None for text in texts], pa.string())
