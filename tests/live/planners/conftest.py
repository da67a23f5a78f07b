"""A log of some doors, and an oracle of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from tests.live.planners.asker import Asker


@pytest.fixture
def path(tmp_path: Path, clock: SteadyClock) -> Path:
    """A log of five doors, one in each state; the last has no name."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        for name, state in [("main_door", "open"), ("back door", "closed"), ("3", "unknown"),
                            ("gate", "moving"), ("", "offline")]:  # fmt: skip
            log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, state=state, name=name)
    return tmp_path / "log"


@pytest.fixture
def ask(path: Path, clock: SteadyClock) -> Iterator[Asker]:
    """Ask that log."""
    asker = Asker(path, clock=clock)
    yield asker
    asker.close()
