"""Logs and files whose paths are not UTF-8: what is made of a log lies under just those names."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.url_path import UrlPath
from semmap_log.fleet.fetching import fetch
from semmap_log.fleet.shipping import ship
from semmap_log.log.replay.maintenance import verify
from tests.bucket import bucket, environment
from tests.verbs import ran

__all__ = ["bucket", "environment"]

FOLDER, LOG, OUT = (os.fsdecode(name) for name in (b"f\xff", b"l\xfeog", b"o\xfd"))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("made") / FOLDER / LOG
    path.parent.mkdir()
    with sl.create(path, tz="UTC", building="house", robot="tug", compact=False) as log:
        door = log.add_door(name="front", x=1.0, y=1.0, theta=0.0, width=1.0)
        for i in range(30):
            log.observe(door, "open" if i % 3 else "closed", accuracy=0.9)
    return path


@pytest.fixture
def log(made: Path, tmp_path: Path) -> Path:
    (tmp_path / FOLDER).mkdir()
    return Path(shutil.copytree(made, tmp_path / FOLDER / LOG))


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return what a command that ends well prints."""
    code, out, err = ran(capsys, *arguments)
    assert code == 0, err
    return out


WRITTEN = {
    "report": ["report", "LOG", "OUT.html"],
    "costmap over time": ["costmap", "LOG", "OUT.mcap"],
    "query": ["sql", "LOG", "select * from doors", "--out", "OUT.parquet"],
    "copy": ["copy", "LOG", "OUT"],
    "doors": ["export", "LOG", "OUT.yaml", "--default-prob", "0.5"],
    "pseudonymous": ["export", "LOG", "OUT.parquet", "--pseudonymous"],
    **{name: ["export", "LOG", f"OUT{name}"] for name in
       (".csv", ".geojson", ".html", ".jsonl", ".mcap", ".bag", ".parquet", ".pddl", "")},
}  # fmt: skip


@pytest.mark.parametrize("verb", WRITTEN)
def test_what_is_written_has_the_name_that_was_asked_for(
    log: Path, verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And nothing else is there."""
    out = tmp_path / OUT
    given = [each.replace("LOG", str(log)).replace("OUT", str(out)) for each in WRITTEN[verb]]

    run(capsys, *given)

    named = {path.name for path in tmp_path.iterdir()} - {FOLDER}
    assert named == {next(Path(each).name for each in given if OUT in each)}


@pytest.mark.viewer
def test_a_recording_of_it_is_written(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For rerun, which itself takes no such name."""
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")

    run(capsys, "view", log, "--save", tmp_path / f"{OUT}.rrd", "--no-beliefs")

    assert (tmp_path / f"{OUT}.rrd").stat().st_size > 1000


def test_an_index_is_made_and_answers(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Queries and histories of a door are read from its tables."""
    before = run(capsys, "history", log, "front")

    run(capsys, "index", log)

    assert list((log / "index").glob("*.parquet"))
    for parquet in log.glob("*.mcap"):
        assert (log / "index" / f"{parquet.stem}.events.parquet").exists()
    assert run(capsys, "history", log, "front") == before
    assert run(capsys, "sql", log, "select count(*) from events").split() == ["count_star()", "32"]
    assert not [one for one in verify(log).findings if one.severity]


def test_a_join_names_it(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The bytes of its path are escapes of JSON's: what is read there is the path itself."""
    definition, plain = tmp_path / f"{OUT}.join.json", tmp_path / "plain"
    with sl.create(plain, tz="UTC") as other:
        other.add_door(name="far", x=90.0, y=90.0, theta=0.0, width=1.0)

    run(capsys, "join", definition, log, plain)

    places = [one["log"] for one in json.loads(definition.read_text(encoding="utf-8"))["logs"]]
    assert sorted(places) == [f"{FOLDER}/{LOG}", "plain"]
    assert {door.name for door in sl.read(definition).replay().doors.values()} == {
        "tug/front", "plain/far",
    }  # fmt: skip
    run(capsys, "join", definition, "--write", tmp_path / f"{OUT} joined")
    assert len(sl.read(tmp_path / f"{OUT} joined").replay().doors) == 2


@pytest.mark.parametrize("job", ["map", "openings", "probabilities", "verify", "info", "export"])
def test_a_fleet_has_it(
    log: Path, job: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In tables its bytes are spelt out; answers are kept, and found again."""
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    results, out = tmp_path / f"{OUT} results", tmp_path / f"{OUT} lake"
    more = ["--out", out] if job == "export" else []
    asked = ["fleet", job, log, "--engine", "serial", "--results", results, *more]

    first, second = (run(capsys, *asked) for _ in range(2))

    assert first == second
    if job == "export":
        assert len(list(out.rglob("*.parquet"))) == 1
    else:
        assert f"{os.fsencode(log)!r}"[2:-1] in first or job == "openings"


def test_shipped_and_fetched_it_is_as_it_was(log: Path, bucket: str, tmp_path: Path) -> None:
    """Whatever its segments are called there."""
    ship(log, UrlPath(bucket))
    fetch(UrlPath(bucket), tmp_path / OUT)

    fetched, here = (sl.read(path).replay().doors for path in (tmp_path / OUT, log))
    assert repr(dict(fetched)) == repr(dict(here))  # some numbers of it are NaN
