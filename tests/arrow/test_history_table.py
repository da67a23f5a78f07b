"""Batches joined with their commits, wherever both are cut."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.arrow.history_table import HistoryTables
from semmap_log.domain.commits import Commit, Note
from semmap_log.domain.doors import DoorId
from semmap_log.domain.events import DoorRemoved
from tests.batches import batch_of

EVENTS = 12
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


@settings(deadline=None)
@given(cuts, cuts, st.sets(st.integers(0, EVENTS - 1), min_size=1))
def test_each_event_has_what_its_own_commit_says(
    batch_cuts: list[int], commit_cuts: list[int], kept: set[int]
) -> None:
    """
    Commits longer than a batch, batches of many commits, commits of which no event is asked for.
    """
    commits = [commit(*ends) for ends in pairwise(commit_cuts)]
    whole = batch_of([DoorRemoved(door_id=DoorId(1), happened_ns=0)] * EVENTS)
    tables = HistoryTables(iter(commits))

    def rows() -> Iterator[tuple[int, str | None, str | None, str, bool]]:
        for first, end in pairwise(batch_cuts):
            chosen = [n in kept and first <= n < end for n in range(EVENTS)]
            batch = whole.select(np.array(chosen))
            if len(batch):
                table = tables.table(batch, batch.number % 3 == 0)
                names = ("event", "actor", "reason", "command_id", "retracted")
                yield from zip(*(table.column(n).to_pylist() for n in names), strict=True)

    found = list(rows())

    mine = {n: c for c in commits for n in range(c.first_event, c.last_event + 1)}
    assert [
        (n, mine[n].note.actor or None, mine[n].note.reason, mine[n].command_id.hex(), n % 3 == 0)
        for n in sorted(kept)
    ] == found
