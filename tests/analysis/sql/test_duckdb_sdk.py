"""Without DuckDB everything else works, and a query says how to get it."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.errors import MissingExtraError

INSTALL = re.escape("duckdb is not installed; install it with: pip install 'semmap-log[sql]'")


@pytest.fixture
def without_duckdb(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if DuckDB had never been installed."""
    monkeypatch.setitem(sys.modules, "duckdb", None)
    monkeypatch.delattr("semmap_log.analysis.sql", raising=False)
    for name in [name for name in sys.modules if name.startswith("semmap_log.analysis.sql")]:
        monkeypatch.delitem(sys.modules, name)


@pytest.mark.usefixtures("without_duckdb")
def test_a_query_says_what_to_install(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the line that gets all that a query needs."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="front")
    opened = sl.read(tmp_path / "log")

    with pytest.raises(MissingExtraError, match=INSTALL):
        opened.sql("from doors")
    with pytest.raises(SystemExit) as left:
        main(["sql", str(tmp_path / "log"), "from doors"])

    assert 1 == left.value.code
    assert re.search(INSTALL, capsys.readouterr().err)
    assert "front" == opened.replay().doors[sl.DoorId(1)].name
