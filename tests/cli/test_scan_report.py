"""`scan-report` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorAnnotated
from semmap_log.interop.formats.kept_scans.writing import keeping_scans
from tests.analysis.scans.some_scans import LINE, seen_visit
from tests.analysis.scans.some_visits import START_NS
from tests.conftest import SteadyClock
from tests.interop.formats.bags.bags_of_others import write_mcap
from tests.interop.topics.laser_room import DOOR, SHUT, LaserRoom
from tests.interop.topics.robots import START, S
from tests.verbs import Refuses, run

pytestmark = pytest.mark.usefixtures("terminal")


@pytest.fixture
def office(tmp_path: Path) -> Path:
    """A log with three doors, of whose visits the scans were kept; of the third there are none."""
    path, clock = tmp_path / "office", SteadyClock(START_NS)
    x, y, theta, width = LINE
    with sl.create(path, tz="Europe/Vienna", clock=clock) as log:
        for n, name in enumerate(("front", "lab\x1b[31m", "会議室"), start=1):
            door = DoorId(n)
            log.append([DoorAdded(door_id=door, x=x, y=y, theta=theta, width=width)])
            log.append([DoorAnnotated(door_id=door, key="name", value=name)])
        with keeping_scans(path, log.info.log_id) as kept:
            for n in range(6):
                visit, scans = seen_visit(30 * n, behind_m=0.2)
                kept.keep(visit, line=LINE, level=0, scans=scans)
            visit, scans = seen_visit(
                300, door_id=2, state=DoorState.UNKNOWN, why="ajar", accuracy=0.5
            )
            kept.keep(visit, line=LINE, level=0, scans=scans)
    return path


def test_a_row_a_door_and_what_should_be_looked_at(
    office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Doors with warnings are marked; those never met are named; nothing steers the terminal."""
    assert run("scan-report", office) == 0

    out, err = capsys.readouterr()
    front = next(line for line in out.splitlines() if line.startswith("front"))
    assert front.split() == ["front", "!", "6", "0", "6", "0", "0", ".98", ".90", "+0.20", "m"]
    assert "never met: 1 door: 会議室" in out
    assert "\x1b[31m" not in out + err
    assert r"lab\x1b[31m" in out
    said = " ".join(err.split())
    assert "door front: beams end 0.20 m behind its line on average (6 visits)" in said


@pytest.mark.parametrize("columns", [40, 80, 160])
def test_it_fits_the_terminal(
    office: Path, columns: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))

    assert run("scan-report", office) == 0

    assert max(map(len, capsys.readouterr().out.splitlines())) <= columns


def test_one_document_for_machines(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Absent numbers are null, warnings have a word that stays."""
    assert run("scan-report", office, "--json") == 0

    told = json.loads(capsys.readouterr().out)
    front, lab = told["doors"]
    assert (front["door_id"], front["name"], front["visits"]) == (1, "front", 6)
    assert (front["open"], front["closed"], front["undecided"]) == (0, 6, 0)
    assert front["said_accuracy"] == pytest.approx(0.98)
    assert front["behind_m"] == pytest.approx(0.2)
    assert [warning["concern"] for warning in front["warnings"]] == ["offset"]
    assert (lab["said_accuracy"], lab["behind_m"]) == (None, None)
    assert lab["undecided_because"] == {"ajar": 1}
    assert told["not_met"] == [{"door_id": 3, "name": "会議室"}]


def test_some_doors_some_times(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As other verbs choose them."""
    assert run("scan-report", office, "--door", "front", "--until", f"@{START_NS // S + 60}",
               "--json") == 0  # fmt: skip

    (front,) = json.loads(capsys.readouterr().out)["doors"]
    assert front["visits"] == 2


def test_it_is_drawn(office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Into a picture, or into a folder with one a door."""
    pytest.importorskip("matplotlib")

    assert run("scan-report", office, "--plot", tmp_path / "all.png") == 0
    assert run("scan-report", office, "--plot", tmp_path / "each") == 0
    assert run("scan-report", office, "--door", "会議室", "--plot", tmp_path / "no.png") == 0

    err = capsys.readouterr().err
    assert "all.png: 2 doors." in err
    assert (tmp_path / "all.png").stat().st_size > 10_000
    assert sorted(path.name for path in (tmp_path / "each").iterdir()) == [
        "door_1.png", "door_2.png",
    ]  # fmt: skip
    assert "no.png: not written; no door was visited." in err
    assert not (tmp_path / "no.png").exists()


def test_a_bag_is_looked_through(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With no scan topic named: its only laser."""
    x, y, theta, width = DOOR
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(x=x, y=y, theta=theta, width=width, name="lab", at=START - S)
    write_mcap(tmp_path / "patrol.mcap", LaserRoom(state=lambda _: SHUT).said())

    assert run("scan-report", tmp_path / "office", tmp_path / "patrol.mcap") == 0

    out, err = capsys.readouterr()
    assert next(line for line in out.splitlines() if line.startswith("lab")).split()[1:4] == [
        "1", "0", "1",
    ]  # fmt: skip
    assert "scans of /scan:" in err


def test_what_cannot_be_is_refused(
    office: Path, monkeypatch: pytest.MonkeyPatch, refuses: Refuses
) -> None:
    monkeypatch.chdir(office.parent)

    refuses("""
        scan-report office --plot x.gif
        scan-report office --scan /scan
        scan-report office --plot office/x.png
        scan-report office nothing.bag
    """)


def test_without_kept_scans_it_says_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And with a torn file what is there is told."""
    with sl.create(tmp_path / "bare", tz="UTC") as log:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0)

    assert run("scan-report", tmp_path / "bare") == 1

    assert "no scans are kept next to this log" in " ".join(capsys.readouterr().err.split())
