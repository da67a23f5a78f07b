"""Without pyarrow or pandas everything else works, and asking for them says how to get them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import MissingExtraError
from semmap_log.interop.exporting.log_files import export

NEEDS_IT = ("arrow_sdk", "table", "history_table", "parquet", "event_view")
INSTALL = r"pip install 'semmap-log\[arrow\]'"


@pytest.fixture
def without_pyarrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if pyarrow had never been installed."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for name in NEEDS_IT:
        monkeypatch.delitem(sys.modules, f"semmap_log.core.arrow.{name}", raising=False)
        monkeypatch.delattr(f"semmap_log.core.arrow.{name}", raising=False)


@pytest.mark.usefixtures("without_pyarrow")
@pytest.mark.parametrize("ask", ["to_arrow", "to_pandas", "to_polars"])
def test_a_log_as_a_table_says_it_too(tmp_path: Path, ask: str) -> None:
    """Whichever form is asked for."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        with pytest.raises(MissingExtraError, match=f"pyarrow.*{INSTALL}"):
            getattr(log, ask)()


def test_polars_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has an extra of its own: pandas is enough for most."""
    monkeypatch.setitem(sys.modules, "polars", None)
    with sl.create(tmp_path / "log", tz="UTC") as log:
        with pytest.raises(MissingExtraError, match=r"install 'semmap-log\[polars\]'"):
            log.to_polars()
        assert 0 == len(log.to_pandas())


def test_so_does_a_frame_where_only_pandas_is_missing() -> None:
    """The table can be had all the same."""
    code = """
import sys

class NoPandas:
    def find_spec(self, name, path=None, target=None):
        if name == "pandas":
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, NoPandas())
from semmap_log.errors import MissingExtraError
from semmap_log.core.batches.event_batch import EventBatch
assert 0 == EventBatch.from_events([]).to_arrow().num_rows
try:
    EventBatch.from_events([]).to_pandas()
except MissingExtraError as error:
    print(error)
"""

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert re.match(f"pandas.*{INSTALL}", done.stdout)


@pytest.mark.usefixtures("without_pyarrow")
def test_an_export_says_it_too_and_writes_nothing(tmp_path: Path) -> None:
    """No half file, no litter."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        with pytest.raises(MissingExtraError, match=f"pyarrow.*{INSTALL}"):
            export(log, tmp_path / "x.parquet")

    assert ["log"] == [path.name for path in tmp_path.iterdir()]


def test_a_timeline_needs_neither(tmp_path: Path) -> None:
    """Only its frame does: reading a log and asking it loads no pyarrow."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
    code = (
        "import sys, semmap_log as sl; sl.read(sys.argv[1]).timeline(1);"
        "print([name for name in ('pyarrow', 'pandas') if name in sys.modules])"
    )

    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "log"], capture_output=True, text=True, check=True
    )

    assert "[]" == done.stdout.strip()
