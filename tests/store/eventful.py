"""A small log with something of everything, and how to change its bytes."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.model.events import FloorMap, Retracted
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock

SEGMENT_COMMITS = 4


def eventful_log(
    path: Path,
    *,
    per_segment: int = SEGMENT_COMMITS,
    copy: Path | None = None,
    accuracy: float = 0.9,
) -> Path:
    """Write a log: doors, names, notes, sightings, a floor map, a retraction; return its path.

    Args:
        path: Where.
        per_segment: Commits in a segment.
        accuracy: Of the sightings: another makes another log with the same id.
        copy: Also a copy of the folder, before its last segment is closed.
    """
    random_bytes = random.Random(3).randbytes
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", per_segment)
        with sl.create(
            path, tz="UTC", clock=SteadyClock(), entropy=random_bytes, compact=False
        ) as log:
            front = log.add_door(x=1, y=2, theta=0, width=0.9, name="front", actor="survey")
            back = log.add_door(name="back")
            for state in ("open", "closed", "open"):
                log.observe(front, state, accuracy=accuracy)
            log.append([FloorMap(level=2, resolution=0.05, origin_x=0, origin_y=0,
                                 cells=np.zeros((300, 300), np.int8))])  # fmt: skip
            log.observe(back, "open", reason="heard it")
            heard = log.state.event
            log.append([Retracted(first_event=heard, last_event=heard)])
            for state in ("closed", "open", "closed"):
                log.observe(back, state)
            if copy is not None:
                shutil.copytree(path, copy)
    return path


def flip(path: Path, at: int, bit: int = 0) -> None:
    """Flip one bit of a file."""
    data = bytearray(path.read_bytes())
    data[at] ^= 1 << bit
    path.write_bytes(data)


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file of a folder."""
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}
