"""The quick way to a commit's bytes gives exactly the bytes of the general one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.batches.taken_columns import TakenColumns
from semmap_log.core.messages import OBJECT_KINDS
from semmap_log.core.model.commits import Durability, Note
from semmap_log.log.door_log.door_index import SIGHTINGS
from semmap_log.store.commit_records import CommitBuilder, Stamp
from semmap_log.store.writing.uniform_commit import FEW, MOST, uniform_commit
from tests.strategies import events, fixed_size

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


@settings(deadline=None)
@given(stamps, st.lists(events, min_size=1, max_size=4))
def test_it_leaves_alone_what_it_cannot(stamp: Stamp, given_events) -> None:
    """Several kinds, kinds with texts, a note: the general way is for them."""
    kinds = {event.kind for event in given_events}

    fits = uniform_commit(stamp, Note(), given_events) is not None
    assert (len(kinds) == 1 and not kinds & OBJECT_KINDS) == fits
    assert uniform_commit(stamp, Note(actor="me"), given_events) is None


def test_it_leaves_large_commits_alone() -> None:
    """Those may be split."""
    from semmap_log.core.model.doors import DoorId
    from semmap_log.core.model.events import DoorRemoved

    stamp = Stamp(0, 1, bytes(32), bytes(16), 1, 1, bytes(16))
    assert uniform_commit(stamp, Note(), [DoorRemoved(door_id=DoorId(1))] * MOST) is not None
    assert uniform_commit(stamp, Note(), [DoorRemoved(door_id=DoorId(1))] * (MOST + 1)) is None
    assert uniform_commit(stamp, Note(), []) is None
