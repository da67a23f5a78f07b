"""`import --scan --propose-doors`: listed, drawn, added only when told so."""

from __future__ import annotations

import json
import math
import shlex
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorAdded
from tests.interop.formats.bags.bags_of_others import write_mcap
from tests.interop.topics.laser_room import DOOR, LaserRoom, moved, turned
from tests.interop.topics.robots import START
from tests.verbs import Refuses, run


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """A drive along the corridor, and one through the door."""
    through = LaserRoom(
        seconds=8.0, begins_s=60.0, state=lambda _: [],
        drive=lambda t: moved(4.45, -0.9 + 0.5 * t) @ turned("z", math.pi / 2),
    )  # fmt: skip
    write_mcap(tmp_path / "x.mcap", [*LaserRoom(state=lambda _: []).said(), *through.said()])
    return tmp_path / "x.mcap"


@pytest.fixture
def office(tmp_path: Path) -> Path:
    """A log without doors."""
    sl.create(tmp_path / "office", tz="UTC", robot="tug1").close()
    return tmp_path / "office"


def _added(office: Path) -> list[DoorAdded]:
    return [each.event for b in sl.read(office).batches(kinds=[DoorAdded]) for each in b]


def test_they_are_listed_and_nothing_is_written(
    office: Path, bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As JSON: place, width, what speaks for it; the log stays as it is."""
    before = {each: each.read_bytes() for each in office.iterdir()}

    assert run("import", office, bag, "--scan", "--propose-doors", "--json") == 0

    told = json.loads(capsys.readouterr().out)
    assert told["source"] == "scan:laser wall-gaps"
    assert told["added"] == []
    first = told["proposals"][0]
    x = first["x"] + first["width"] / 2 * math.cos(first["theta"])
    assert x == pytest.approx(DOOR[0] + DOOR[3] / 2, abs=0.15)
    assert first["evidence"]["passed"] == 1
    assert before == {each: each.read_bytes() for each in office.iterdir()}


def test_with_yes_they_are_doors_and_not_proposed_again(
    office: Path, bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One commit that names laser and method; the doors are there since the first scan."""
    assert run("import", office, bag, "--scan", "--propose-doors", "--yes", "--actor", "eve") == 0
    (commit,) = sl.read(office).commits()
    assert (commit.note.source, commit.note.actor) == ("scan:laser wall-gaps", "eve")
    (door,) = sl.read(office).replay().doors.values()
    assert door.name in {"door-at 4.4 1.2", "door-at 4.5 1.2"}
    assert abs(_added(office)[0].happened_ns - START) < 10**9
    capsys.readouterr()

    assert run("import", office, bag, "--scan", "--propose-doors", "--yes") == 0

    assert "0 proposals" in capsys.readouterr().err
    assert len(_added(office)) == 1


def test_a_number_that_no_proposal_has_is_refused(
    office: Path, bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before anything is written."""
    words = ("import", office, bag, "--scan", "--propose-doors", "--yes", "--only", 1, "--only", 9)

    assert run(*words) == 1

    assert "--only 9: expected a number up to 1" in capsys.readouterr().err
    assert _added(office) == []


def test_the_command_that_adds_them_has_what_was_asked_for(
    office: Path, bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It can be typed as it is told."""
    asked = ("--scan", "/scan", "--heights", "0.2,1", "--level", "0", "--propose-doors")
    assert run("import", office, bag, *asked) == 0
    said = capsys.readouterr().err
    assert "Look at them (--plot doors.png)" in said
    (line,) = [each for each in said.splitlines() if "Nothing was added" in each]

    words = shlex.split(line.partition("all of them: semmap-log ")[2].partition(";")[0])

    assert [*asked, "--yes"] == words[3:]
    assert run(*words) == 0
    assert 1 == len(_added(office))


def test_they_are_drawn(office: Path, bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Over what the laser saw, with the numbers of the table."""
    pytest.importorskip("matplotlib")
    picture = office.parent / "doors.svg"

    assert run("import", office, bag, "--scan", "--propose-doors", "--plot", picture) == 0

    assert "Look at them" not in capsys.readouterr().err
    drawn = picture.read_text()
    assert "Doors proposed from x.mcap: 1" in drawn
    assert ">1</text>" in drawn


def test_options_that_need_others(office: Path, bag: Path, refuses: Refuses) -> None:
    """Are refused without them."""
    refuses(f"""
        import {office} {bag} --propose-doors
        import {office} {bag} --scan --yes
        import {office} {bag} --scan --propose-doors --only 1
    """)
