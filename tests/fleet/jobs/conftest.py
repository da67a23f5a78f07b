"""A fleet of eight logs, made once."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fleet.jobs.fleets import make_log

LOGS = 8


@pytest.fixture(scope="session")
def made_fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nobody writes here."""
    folder = tmp_path_factory.mktemp("fleet") / "logs"
    folder.mkdir()
    for seed in range(LOGS):
        make_log(folder / f"tug{seed}", seed)
    return folder


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
