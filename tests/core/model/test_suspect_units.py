"""Degrees and millimetres are asked about, by whichever way they come in; nothing is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.model.doors import suspect_cells, suspect_units
from semmap_log.interop.importing.importing import import_file
from semmap_log.interop.topics.topic_rules import ReadDoorMap
from tests.interop.topics.robots import Listener, Robot

DEGREES = "theta 90 rad is more than a turn: degrees?"
MILLIMETRES = "width 900 m is more than a gate's: millimetres, or centimetres?"


@pytest.mark.parametrize(
    ("theta", "width", "expected"),
    [
        (90.0, 900.0, [DEGREES, MILLIMETRES]),
        (-180.0, 0.9, ["theta -180 rad is more than a turn: degrees?"]),
        (6.2831853, 20.0, []),
        (float("nan"), float("nan"), []),
    ],
)
def test_what_no_door_is_like_is_asked_about(
    theta: float, width: float, expected: list[str]
) -> None:
    """A turn, and the gate of a hall, are well."""
    assert expected == list(suspect_units(theta=theta, width=width))


def test_cells_in_millimetres_are_asked_about() -> None:
    """And an origin that is turned by degrees."""
    assert 2 == len(list(suspect_cells(resolution=50.0, theta=90.0)))
    assert [] == list(suspect_cells(resolution=0.05, theta=-1.6))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("doors.yaml", "1: {position: {x: 0, y: 0, theta: 90}, width: 900}"),
        ("doors.jsonl", json.dumps({"kind": "DoorAdded", "x": 0, "y": 0, "theta": 90,
                                    "width": 900})),
    ],
)  # fmt: skip
def test_an_import_and_info_ask_about_it(tmp_path: Path, name: str, text: str) -> None:
    """The values are as they are."""
    (tmp_path / name).write_text(text)
    with sl.create(tmp_path / "log", tz="UTC") as log:
        told = import_file(log, tmp_path / name).plan.warnings
        warnings = log.summary().warnings

    assert [True, True] == [DEGREES in told[0], MILLIMETRES in told[1]]
    assert [f"door 1: {DEGREES}", f"door 1: {MILLIMETRES}"] == warnings


def test_add_asks_about_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At once, on stderr."""
    sl.create(tmp_path / "log", tz="UTC").close()
    with pytest.raises(SystemExit) as left:
        main(["add", str(tmp_path / "log"), "--x=0", "--y=0", "--theta=90", "--width=900"])

    assert 0 == left.value.code
    assert f"warning: {DEGREES}\nwarning: {MILLIMETRES}\n" in capsys.readouterr().err


def test_a_server_is_asked_about_it() -> None:
    """Of its map of doors."""
    listener = Listener({"/doors": ReadDoorMap()})
    listener.hear("/doors", Robot().door_map([{"door_id": 1, "pos_theta": 90.0}]))

    assert f"another unit; taken as they are: door 1: {DEGREES}" in listener.told[0]
