"""`semmap-log rebase`, as a user types it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from tests.turned_maps import OFFICE, QUARTER, SHIFT_M, turned_floor, write_map
from tests.verbs import Refuses, run

BY = ",".join(map(str, QUARTER))
ID = "ab" * 16


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the office without robots, and a new map of it."""
    monkeypatch.chdir(tmp_path)
    old = sl.read(OFFICE)
    with sl.create("office", tz="UTC") as log:
        log.append([old.floor_map()])
        for door in old.replay().doors.values():
            log.add_door(x=door.x, y=door.y, theta=door.theta, width=door.width, name=door.name)
    write_map(turned_floor(old.floor_map()), Path("new.yaml"))
    return tmp_path


def corners(*names: str, off_m: float = 0.0) -> str:
    """Return pairs: four corners, the last of them wrongly measured."""
    rows = ["old_x,old_y,new_x,new_y,name"]
    places = ((2, -12), (24, -12), (24, -2), (2, -2))
    for name, (x, y) in zip(names or "abcd", places, strict=True):
        new_x = SHIFT_M[0] - y + (off_m if (x, y) == places[-1] else 0)
        rows.append(f"{x},{y},{new_x},{SHIFT_M[1] + x},{name}")
    return "\n".join(rows) + "\n"


def events() -> int:
    return sl.read("office").last_event() + 1


def poses() -> list[tuple[float, float, float]]:
    doors = sl.read("office").replay().doors.values()
    return [(round(d.x, 6), round(d.y, 6), round(d.theta, 6)) for d in doors]


def turned_poses() -> list[tuple[float, float, float]]:
    made = []
    for door in sl.read(OFFICE).replay().doors.values():
        theta = math.remainder(door.theta + math.pi / 2, math.tau)
        made.append((round(SHIFT_M[0] - door.y, 6), round(SHIFT_M[1] + door.x, 6), round(theta, 6)))
    return made


def answer(capsys: pytest.CaptureFixture[str]) -> Any:
    return json.loads(capsys.readouterr().out)


def test_by_a_transform(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each door is shown, before and after; the note tells who and why."""
    before = events()

    code = run("rebase", "office", "new.yaml", "--by", BY, "--actor", "ann", "--reason", "anew")

    said = capsys.readouterr().out
    assert (code, events()) == (0, before + 4)
    assert "hardware_door" in said
    assert "old map to new map: 40,-7.5,1.5708" in said
    assert f"event {before}..{before + 3}" in said
    assert turned_poses() == poses()
    last = list(sl.read("office").history())[-1]
    assert (last.actor, last.reason) == ("ann", "anew")


def test_a_dry_run_writes_nothing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Not a byte, and says the same."""
    files = {path: path.read_bytes() for path in Path("office").rglob("*") if path.is_file()}

    assert 0 == run("rebase", "office", "new.yaml", "--by", BY, "--dry-run", "--json")
    dry = answer(capsys)
    assert files == {p: p.read_bytes() for p in Path("office").rglob("*") if p.is_file()}

    assert 0 == run("rebase", "office", "new.yaml", "--by", BY, "--json")
    wet = answer(capsys)
    assert (dry.pop("dry_run"), wet.pop("dry_run")) == (True, False)
    assert dry.items() <= wet.items()
    assert [door["on_map"] for door in dry["doors"]] == [True] * 3


def test_by_pairs(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The residual of each is shown, and the fit is the transform."""
    Path("pairs.csv").write_text(corners("a", "b", "", "d"))

    code = run("rebase", "office", "new.yaml", "--pairs", "pairs.csv", "--json")

    fit = answer(capsys)["fit"]
    assert (code, turned_poses()) == (0, poses())
    assert ["a", "b", "line 4", "d"] == [pair["name"] for pair in fit["pairs"]]
    assert fit["worst_m"] < 1e-9


def test_a_bad_pair_is_named_and_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is written; with a greater limit it is taken."""
    Path("pairs.csv").write_text(corners(off_m=2.0))
    before = events()

    code = run("rebase", "office", "new.yaml", "--pairs", "pairs.csv")

    said = capsys.readouterr()
    assert (code, events()) == (1, before)
    assert "does not fit the others: d; without it the greatest residual is 0.00 m" in said.err
    assert "d" in said.out
    assert "residual" in said.out
    assert 0 == run("rebase", "office", "new.yaml", "--pairs", "pairs.csv", "--most-residual", "3")


def test_doors_as_pairs_may_be_sent_again(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They lie elsewhere after the first time: what counts is where they lay before it."""
    rows = [f"{i},{x!r},{y!r}" for i, (x, y, _) in enumerate(turned_poses(), start=1)]
    Path("doors.csv").write_text("door,new_x,new_y\n" + "\n".join(rows) + "\n")
    asked = ("rebase", "office", "new.yaml", "--pairs", "doors.csv", "--command-id", ID, "--json")

    assert 0 == run(*asked)
    first = answer(capsys)
    assert 0 == run(*asked)
    again = answer(capsys)

    assert turned_poses() == poses()
    assert (first.pop("repeated"), again.pop("repeated")) == (False, True)
    assert first == again


def test_measured_doors_win(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """How many, and how far off they are, is said; doors that the log does not have are named."""
    (x, y, theta), *_ = turned_poses()
    place = "{}:\n  position: {{x: {}, y: {}, theta: {}}}\n  width: 2.0\n  status: OPEN\n"
    text = place.format(1, x + 0.3, y, theta) + place.format(77, 0, 0, 0)
    Path("measured.yaml").write_text(text)

    code = run("rebase", "office", "new.yaml", "--by", BY, "--doors", "measured.yaml")

    said = capsys.readouterr()
    assert code == 0
    assert "measured again: 1 door; at most 0.30 m from where the transform puts them" in said.out
    assert "measured.yaml:6: door 77" in said.err
    door = sl.read("office").replay().doors[sl.DoorId(1)]
    assert (round(door.x - x, 6), door.width, door.state) == (0.3, 2.0, sl.DoorState.UNKNOWN)
    assert poses()[1:] == turned_poses()[1:]


def test_doors_off_the_map_are_named(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A wrong transform shows."""
    assert 0 == run("rebase", "office", "new.yaml", "--by", "0,0,0", "--dry-run")

    assert "doors that lie off the new map: door 1, 2, 3" in capsys.readouterr().err


def test_what_is_wrong_is_said(here: Path, refuses: Refuses) -> None:
    """And nothing is written."""
    Path("one.csv").write_text("old_x,old_y,new_x,new_y\n1,2,3,4\n")
    Path("wrong.csv").write_text("old_x,old_y,new_x,new_y\n1,2,x,4\n")
    Path("nobody.csv").write_text("door,new_x,new_y\nnobody,3,4\n")
    before = events()

    refuses(f"""
        rebase office new.yaml
        rebase office new.yaml --by {BY} --pairs x.csv
        rebase office new.yaml --by 1,2
        rebase office new.yaml --by 1,2,nan
        rebase office new.yaml --by {BY} --most-residual 1
        rebase office new.yaml --by {BY} --level L9
        rebase office new.yaml --pairs one.csv
        rebase office new.yaml --pairs wrong.csv
        rebase office new.yaml --pairs nobody.csv
        rebase office new.yaml --by {BY} --doors new.yaml
    """)

    assert before == events()
