"""An export as a table of Delta's and of Iceberg's: one commit a run, each event once."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import EngineError
from semmap_log.fleet.jobs.fleet_run import Fleet
from tests.fleet.jobs.fleets import make_log


@pytest.fixture
def two(tmp_path: Path) -> Fleet:
    (tmp_path / "logs").mkdir()
    for seed in range(2):
        make_log(tmp_path / "logs" / f"tug{seed}", seed)
    found: Fleet = sl.fleet(tmp_path / "logs", engine="serial")
    return found


def keys_of(fleet: Fleet) -> set[tuple[str, int]]:
    """(log id, number) of every event, as a reader of one log has them."""
    logs = [sl.read(place) for place in fleet.places]
    return {(log.info.log_id, n) for log in logs for n in range(log.last_event() + 1)}


def grow(fleet: Fleet) -> None:
    with sl.append(fleet.places[0]) as log:
        log.observe("d0", "open")


READ_DELTA = """
import json, os, sys
from deltalake import DeltaTable
version = int(sys.argv[2]) if sys.argv[2:] else None
table = DeltaTable(sys.argv[1], version=version, storage_options={"allow_http": "true"})
rows = table.to_pyarrow_table(columns=["log_id", "event"]).to_pydict()
print(json.dumps([table.version(), list(zip(rows["log_id"], rows["event"]))]), flush=True)
os._exit(0)  # its threads end badly with the interpreter
"""


@pytest.mark.slow
@pytest.mark.parametrize("where", ["disk", "bucket"])
def test_delta_has_each_event_once_also_after_a_log_has_grown(
    two: Fleet, tmp_path: Path, bucket: str, where: str
) -> None:
    """The version before stays readable; a run with nothing new commits nothing."""
    pytest.importorskip("deltalake")
    lake = str(tmp_path / "lake") if where == "disk" else f"{bucket}/lake"

    def export() -> None:
        words = [*two.places, "--out", lake, "--delta", "--engine", "serial"]
        _python("-m", "semmap_log", "fleet", "export", *words)

    def read(*version: int) -> tuple[int, list[tuple[str, int]]]:
        number, rows = json.loads(_python("-c", READ_DELTA, lake, *map(str, version)))
        return number, [(log_id, event) for log_id, event in rows]

    export()
    before = keys_of(two)
    first, rows = read()
    assert (len(before), before) == (len(rows), set(rows))
    export()
    assert first == read()[0]
    grow(two)
    export()

    last, rows = read()
    assert last == first + 1
    assert (len(keys_of(two)), keys_of(two)) == (len(rows), set(rows))
    assert before == set(read(first)[1])


def _python(*words: str) -> str:
    run = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.mark.slow
def test_iceberg_has_each_event_once_also_after_a_log_has_grown(
    two: Fleet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in {
        "TYPE": "sql",
        "URI": f"sqlite:///{tmp_path}/catalog.db",
        "WAREHOUSE": f"file://{tmp_path}/warehouse",
    }.items():
        monkeypatch.setenv(f"PYICEBERG_CATALOG__MINE__{name}", value)
    catalogs = pytest.importorskip("pyiceberg.catalog")  # which looks at the environment now
    pytest.importorskip("sqlalchemy")
    monkeypatch.chdir(tmp_path)

    def read() -> list[tuple[str, int]]:
        table = catalogs.load_catalog("mine").load_table("robots.events")
        rows = table.scan(selected_fields=("log_id", "event")).to_arrow().to_pydict()
        return list(zip(rows["log_id"], rows["event"], strict=True))

    for change in (lambda: None, lambda: None, lambda: grow(two)):
        change()
        two.export("lake", iceberg="mine.robots.events")  # a path of the moment's folder
        rows = read()
        assert (len(keys_of(two)), keys_of(two)) == (len(rows), set(rows))
    with pytest.raises(EngineError, match=r"expected CATALOG\.NAMESPACE\.TABLE"):
        two.export("lake", iceberg="mine")


@pytest.mark.parametrize(("name", "said"), [("deltalake", "deltalake"), ("iceberg", "pyiceberg")])
def test_without_the_package_it_says_how_to_get_it(
    two: Fleet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, said: str
) -> None:
    monkeypatch.setitem(sys.modules, "deltalake", None)
    monkeypatch.setitem(sys.modules, "pyiceberg.catalog", None)

    with pytest.raises(EngineError, match=f"{said} is not installed; install it with: pip install"):
        two.export(tmp_path / "lake", delta=name == "deltalake", iceberg="a.b.c")
