"""A log with a door, a dock, a shutter and a spill."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "office"


@pytest.fixture
def log(path: Path) -> Iterator[sl.DoorLogWriter]:
    """Door 1 `front`, dock 2 `west`, shutter 3 `bay`, spill 4 without a name."""
    with sl.create(path, tz="UTC", clock=SteadyClock()) as opened:
        furnish(opened)
        yield opened


def furnish(log: sl.DoorLogWriter) -> None:
    log.define_class("dock", geometry="point", states="free,taken", blocks="taken")
    log.define_class("shutter")
    log.define_class("spill", geometry="polygon", states="dry,wet", blocks="wet")
    log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="front", state="open")
    log.add_door(object_class="dock", x=4.0, y=2.0, name="west", state="free")
    log.add_door(object_class="shutter", x=5.0, y=0.0, theta=0.0, width=2.0, name="bay",
                 state="closed")  # fmt: skip
    log.add_door(object_class="spill", outline=[(1.0, 3.0), (3.0, 3.0), (3.0, 4.0)], state="wet")
