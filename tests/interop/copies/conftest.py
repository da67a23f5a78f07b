"""A bucket, a clock, caches and temporary files of a test's own."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from semmap_log.core.io.object_cache import VARIABLE
from tests.bucket import bucket, environment

__all__ = ["bucket", "environment"]


@pytest.fixture(autouse=True)
def _own_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("home", "cache", "temporary"):
        (tmp_path / name).mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setenv(VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
