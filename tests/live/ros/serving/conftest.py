"""A log without doors, and a server of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.live.ros.serving.door_server import DoorServer
from tests.live.ros.serving.door_servers import door_server


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A log without doors."""
    sl.create(tmp_path / "log", tz="UTC").close()
    return tmp_path / "log"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Where doors may be saved."""
    (tmp_path / "root").mkdir()
    return tmp_path / "root"


@pytest.fixture
def server(path: Path, root: Path) -> Iterator[DoorServer]:
    """A server of that log."""
    made = door_server(path, root)
    yield made
    made.close()
