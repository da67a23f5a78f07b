"""Batches joined with their commits, wherever both are cut."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.arrow.history_table import history_table
from semmap_log.core.arrow.table import HISTORY_COLUMNS
from semmap_log.core.model.commits import Commit, Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorRemoved
from semmap_log.store.reading.segment_reading import CommitColumns, NoteFinder
from tests.batches import batch_of

EVENTS = 12
NAMES = ("event", "actor", "reason", "command_id", "retracted")
COLUMNS = [column for column in HISTORY_COLUMNS if column.name in NAMES]
cuts = st.sets(st.integers(1, EVENTS - 1)).map(lambda found: [0, *sorted(found), EVENTS])


def commit(first: int, end: int) -> Commit:
    return Commit(
        first_event=first,
        count=end - first,
        recorded_ns=0,
        closed_ns=0,
        command_id=first.to_bytes(16, "big"),
        wall_clock_ns=0,
        monotonic_clock_ns=0,
        boot_id=b"",
        previous_hash=b"",
        hash=b"",
        note=Note(actor=f"actor {first}" if first % 2 else "", reason=f"reason {first}"),
    )


def columns_of(commits: Sequence[Commit]) -> CommitColumns:
    """Return commits as a page that has their Commits tells of them."""
    nothing = np.empty(0, np.int64)
    columns = CommitColumns(nothing, nothing, np.empty((0, 16), np.uint8), nothing, [])
    for each in commits:
        columns = columns.with_commit(each)
    return columns


@settings(deadline=None)
@given(cuts, cuts, st.sets(st.integers(0, EVENTS - 1), min_size=1), st.booleans())
def test_each_event_has_what_its_own_commit_says(
    batch_cuts: list[int], commit_cuts: list[int], kept: set[int], skips: bool
) -> None:
    """Commits longer than a batch, batches of many commits, pages that lack some Commits."""
    commits = [commit(*ends) for ends in pairwise(commit_cuts)]
    mine = {n: c for c in commits for n in range(c.first_event, c.last_event + 1)}
    whole = batch_of([DoorRemoved(door_id=DoorId(1), happened_ns=0)] * EVENTS)
    finder = NoteFinder(mine.get)

    def rows() -> Iterator[tuple[int, str | None, str | None, str, bool]]:
        for first, end in pairwise(batch_cuts):
            chosen = [n in kept and first <= n < end for n in range(EVENTS)]
            batch = whole.select(np.array(chosen))
            here = [c for c in commits if first <= c.last_event < end]
            finder.take(columns_of(here[::2] if skips else here))
            if len(batch):
                table = history_table(
                    batch,
                    COLUMNS,
                    retracted=batch.number % 3 == 0,
                    commits=finder.commits_of(batch.number),
                )
                assert table.schema.names == [column.name for column in COLUMNS]
                yield from zip(*(table.column(n).to_pylist() for n in NAMES), strict=True)

    found = list(rows())

    assert [
        (n, mine[n].note.actor or None, mine[n].note.reason, mine[n].command_id.hex(), n % 3 == 0)
        for n in sorted(kept)
    ] == found
