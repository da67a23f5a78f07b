"""`timeline` and `export x.parquet` as a user types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from tests.golden_text import GoldenText
from tests.verbs import Verb, run

pytestmark = pytest.mark.usefixtures("terminal")


@pytest.fixture
def office(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the log `office`, whose door `front` opens at nine and closes at ten."""
    monkeypatch.chdir(tmp_path)
    with sl.create("office", tz="Europe/Vienna") as log:
        door = log.add_door(name="front", at="2026-03-01T08:00")
        log.observe(door, "open", at="2026-03-01T09:00")
        log.observe(door, "open", at="2026-03-01T09:30")
        log.observe(door, "closed", at="2026-03-01T10:00")
    return tmp_path


def test_the_table_fits_a_terminal(office: Path, run_verb: Verb, golden: GoldenText) -> None:
    """80 columns, in the log's zone, with the shares at the end."""
    code, out, _ = run_verb("timeline", "office", "front", "--at", "2026-03-01T13:00")

    assert 0 == code
    assert max(map(len, out.splitlines())) <= 80
    golden("timeline", "a morning", out)


def test_a_range_cuts_it(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--since and --until, or T1..T2; one JSON document, in seconds and UTC."""
    codes = [
        run("timeline", "office", "1", "--since", "2026-03-01T09:15", "--until",
            "2026-03-01T09:45", "--json"),
    ]  # fmt: skip
    separate = json.loads(capsys.readouterr().out)
    codes.append(
        run("timeline", "office", "1", "--since", "2026-03-01T09:15..2026-03-01T09:45", "--json")
    )
    together = json.loads(capsys.readouterr().out)

    assert [0, 0] == codes
    assert separate == together
    assert {
        "door_id": 1,
        "name": "front",
        "removed": False,
        "intervals": [
            {
                "since": "2026-03-01T08:15:00.000000000Z",
                "until": "2026-03-01T08:45:00.000000000Z",
                "state": "OPEN",
                "sightings": 2,
                "event": 2,
                "seen_seconds": 1800.0,
            }
        ],
        "seconds": {"OPEN": 1800.0},
        "seen_seconds": {"OPEN": 1800.0},
        "lapses": [],
        "hold": {
            "seconds": 5400.0,
            "gaps": 3,
            "gap_seconds": 1800.0,
            "looks": 3,
            "is_measured": True,
        },
    } == together


def test_before_the_door_was_there_nothing_is_shown(
    office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """That is no error; a door that never was is one."""
    codes = [run("timeline", "office", "front", "--at", "2026-02-01")]
    early = capsys.readouterr()
    codes.append(run("timeline", "office", "side"))
    unknown = capsys.readouterr()

    assert [0, 1] == codes
    assert ("", True) == (early.out, "was not in the map" in early.err)
    assert "side" in unknown.err


def test_an_export_says_how_many_events_there_are(
    office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Those that had happened by --at."""
    code = run("export", "office", "x.parquet", "--at", "2026-03-01T09:00")

    assert 0 == code
    assert "x.parquet: 3 events." in capsys.readouterr().err
    assert (office / "x.parquet").is_file()


FEW = "as 1 look tells no median gap)"


@pytest.mark.parametrize(
    ("options", "setting", "holds"),
    [
        ((), "for 3 median gaps between looks", f"for 3 h (3 gaps of 1 h, {FEW}"),
        (("--holds", "1"), "for 1 median gap between looks", f"for 1 h (1 gap of 1 h, {FEW}"),
        (("--holds", "0"), "until the next report", "until the next report"),
    ],
)
def test_how_long_a_sighting_holds_is_a_setting_of_the_log(
    options: tuple[str, ...],
    setting: str,
    holds: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Given when the log is made, shown by `info` and below a timeline; kept by copies."""
    log, copied = str(tmp_path / "log"), str(tmp_path / "copied")
    codes = [run("init", log, *options)]
    with sl.append(log) as writing:
        writing.observe(writing.add_door(name="front"), "open")
    capsys.readouterr()

    codes += [run("info", log), run("timeline", log, "front")]
    out = capsys.readouterr().out
    codes.append(run("copy", log, copied))

    assert [0] * len(codes) == codes
    assert f"hold {setting}" in out
    assert f"a sighting holds {holds}" in out
    assert sl.read(log).info == sl.read(copied).info
    assert sl.read(copied).info.holds == (int(options[1]) if options else 3)


def test_no_setting_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A number below 0, or none, is no number of gaps; nothing is made."""
    monkeypatch.chdir(tmp_path)

    codes = [run("init", "log", "--holds", given) for given in ("-1", "long")]

    assert [2, 2] == codes
    assert "--holds" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
