"""Every answer is the same with compiled loops and without, damage included."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorEvent, Event
from semmap_log.store.chunks import read_chunk_head
from semmap_log.store.record_scan import frames, walk
from semmap_log.store.records import MAGIC
from tests.strategies import events

RECORDINGS = Path(__file__).parents[3] / "recordings"


some = st.builds(
    lambda event, door_id, ns: replace(
        event,
        happened_ns=ns,
        **({"door_id": DoorId(door_id)} if isinstance(event, DoorEvent) else {}),
    ),
    events,
    st.integers(0, 3),
    st.integers(0, 5),
)
"""Events of few doors at few times, so that they meet."""


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(some, max_size=30), st.integers(1, 7))
def test_a_fold_is_the_same(turn: Callable[[bool], None], told: list[Event], parts: int) -> None:
    """Of batches of any size, in any order of their times."""
    batch = EventBatch.from_events(told)

    def fold(*, backward: bool) -> str:
        state = DoorMapState()
        batches = list(batch.parts(parts))
        for part in reversed(batches) if backward else batches:
            state.apply(part)
        return _told(state)

    turn(False)
    expected = [fold(backward=False), fold(backward=True)]
    turn(True)

    assert expected == [fold(backward=False), fold(backward=True)]


def _told(state: DoorMapState) -> str:
    return str({name: np.asarray(values).tolist() for name, values in state.to_arrays().items()})


@pytest.mark.parametrize("name", ["office", "clinic_week"])
def test_a_log_is_read_the_same(turn: Callable[[bool], None], name: str) -> None:
    """All events, each column and each payload, of every batch."""
    turn(False)
    expected = _all_of(RECORDINGS / name)
    turn(True)

    assert expected == _all_of(RECORDINGS / name)


def _all_of(path: Path) -> list[str]:
    """Return all that is in a log as texts, and the error where there is one."""
    found = []
    try:
        for batch in sl.read(path).batches():
            found.append(str(batch.number.tolist()) + str(batch.door_ids().tolist()))
            found += map(str, batch)
    except sl.SemmapError as error:
        found.append(str(error).replace(str(path), ""))
    return found


@pytest.mark.parametrize("seed", range(60))
def test_a_damaged_log_says_the_same(
    turn: Callable[[bool], None], tmp_path: Path, seed: int
) -> None:
    """Where a byte of the records was changed, their CRCs too: what is read, and the message."""
    path = shutil.copytree(RECORDINGS / "office", tmp_path / "office")
    (path / "metadata.yaml").unlink(missing_ok=True)
    segment = path / "office_000000.mcap"
    segment.write_bytes(_damaged(segment.read_bytes(), random.Random(seed)))
    turn(False)
    expected = _all_of(path)
    turn(True)

    assert expected == _all_of(path)


def _damaged(data: bytes, draw: random.Random) -> bytes:
    """Return a segment with a byte of a chunk's records changed, and the CRC of the chunk fitting.

    The CRC of all data is left as it is: who reads a chunk alone does not ask for it.
    """
    chunks = [
        (at, length) for opcode, at, length in frames(data, len(MAGIC), len(data))
        if opcode == Opcode.CHUNK
    ]  # fmt: skip
    at, length = draw.choice(chunks)
    chunk = read_chunk_head(data, at, length)
    records = bytearray(chunk.records(data))
    offsets = walk(records)
    place = int(draw.choice(offsets.tolist()))
    records[min(len(records) - 1, place + draw.randrange(45))] = draw.randrange(256)
    crc = crc32(records).to_bytes(4, "little")
    head, stored = bytearray(data[at : chunk.data_offset]), bytes(records)
    head[33:37] = crc
    if chunk.compression:
        stored = zstandard.ZstdCompressor().compress(stored)
        if len(stored) > chunk.stored_size:
            return data
    return data[:at] + bytes(head) + stored + data[chunk.data_offset + len(stored) :]
