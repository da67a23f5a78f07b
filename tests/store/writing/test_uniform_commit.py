"""The quick way to a commit's bytes gives exactly the bytes of the general one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.batches.taken_columns import TakenColumns
from semmap_log.core.model.commits import Durability, Note
from semmap_log.log.door_log.door_index import SIGHTINGS
from semmap_log.store.commit_records import CommitBuilder, Stamp
from semmap_log.store.writing.uniform_commit import FEW, MOST, uniform_commit
from tests.strategies import fixed_size

hashes = st.binary(min_size=32, max_size=32)
ids = st.binary(min_size=16, max_size=16)
times = st.integers(1, 2**62)

stamps = st.builds(
    Stamp,
    first_event=st.integers(0, 2**40) | st.just(2**32 - 3),
    recorded_ns=times,
    previous_hash=hashes,
    command_id=ids,
    wall_clock_ns=times,
    monotonic_clock_ns=times,
    boot_id=ids,
    durability=st.sampled_from(Durability),
    durable_before=st.integers(0, 2**40),
    content=ids,
)


@pytest.mark.slow
@settings(deadline=None)
@given(stamps, fixed_size, st.sampled_from([1, 2, FEW, FEW + 1, 40, MOST]), st.data())
def test_it_makes_the_same_bytes(stamp: Stamp, first, count: int, data: st.DataObject) -> None:
    """For few events, many, and so many that their chunk is compressed."""
    drawn = data.draw(st.lists(st.none() | times, min_size=1, max_size=min(count, 40)))
    happened = [drawn[i % len(drawn)] for i in range(count)]
    given_events = [replace(first, happened_ns=time) for time in happened]
    builder = CommitBuilder(stamp, Note(), bytes)

    quick = uniform_commit(stamp, Note(), given_events)

    (chunk,) = builder.chunks(given_events)
    assert (chunk, builder.commit) == quick
    if isinstance(first, SIGHTINGS):
        taken = TakenColumns(given_events, {type(first)})
        assert quick == uniform_commit(stamp, Note(), taken)
