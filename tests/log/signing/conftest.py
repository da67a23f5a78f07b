"""A log of three closed segments, and a key outside of it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from semmap_log.log.signing.ed25519_sdk import SigningKey
from tests.log.signing.signed_logs import a_key
from tests.store.eventful import eventful_log


@pytest.fixture(scope="session")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("original")
    return eventful_log(folder / "log", copy=folder / "live")


@pytest.fixture
def log(original: Path, tmp_path: Path) -> Path:
    """A copy to sign and to spoil."""
    return Path(shutil.copytree(original, tmp_path / "log"))


@pytest.fixture
def live(original: Path, tmp_path: Path) -> Path:
    """The same log before its last segment was closed."""
    return Path(shutil.copytree(original.parent / "live", tmp_path / "live"))


@pytest.fixture
def earlier(live: Path) -> Path:
    """The same log before its last segment was begun."""
    max(live.glob("*.mcap")).unlink()
    return live


@pytest.fixture
def key(tmp_path: Path) -> SigningKey:
    return a_key(tmp_path)
