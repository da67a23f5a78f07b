"""What the short forms share: the small log that all of them damage, and where they work."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_injection.fault import Plan
from fault_injection.sample import Sample, make_sample


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Sample:
    """The small log of one of everything; nobody writes to it."""
    return make_sample(tmp_path_factory.mktemp("sample"))


@pytest.fixture
def memory() -> Iterator[Path]:
    """A folder where a sync costs nothing, if the machine has such a place; removed afterwards."""
    fast = Path("/dev/shm")  # a folder of its own is made in it
    with tempfile.TemporaryDirectory(dir=fast if os.access(fast, os.W_OK) else None) as folder:
        yield Path(folder)


@pytest.fixture
def plan(memory: Path, tmp_path: Path) -> Plan:
    """What a kind of fault is asked to do, in a folder that is removed."""
    return Plan(seed=7, folder=memory, keep=tmp_path / "kept")
