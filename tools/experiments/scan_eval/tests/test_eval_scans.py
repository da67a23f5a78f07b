"""`eval_scans.py` on a small building: the form of its document, figures, errors."""

from __future__ import annotations

import json
import subprocess
import sys
from math import cos, inf, radians
from pathlib import Path

import numpy as np
import pytest
from eval_scans import scores, table

from scan_eval.packed_logs import PackedLog, Told
from scan_eval.virtual_leaves import VirtualDay, VirtualLeaf, ranges_to
from scan_eval.visit_scores import Judged, bins, counts, ece, plain_word, said_accuracy, wrong_share
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState
from tests.analysis.scans.scenes import WALLS, WIDTH, cast

TOOL = Path(__file__).parents[2] / "eval_scans.py"
ANGLES = np.radians(np.linspace(-90, 90, 91))
DOORS = [
    {"name": "door", "x": 0, "y": 1, "theta": 0, "width": WIDTH, "truth": "OPEN", "kind": "door"},
    {"name": "wall", "x": 4, "y": 1, "theta": 0, "width": WIDTH, "truth": "CLOSED", "kind": "wall"},
]


def packed(folder: Path, name: str = "tiny") -> Path:
    """Return a folder with a log of a robot that drives past an open door, and a wall, and back."""
    folder.mkdir()
    xs = [*np.arange(-2, 7, 0.3).tolist(), *np.arange(7, -2, -0.3).tolist()]
    poses = np.array([(x, 0.0, np.pi / 2) for x in xs])
    ranges = np.array([cast(pose, WALLS, ANGLES) for pose in poses])
    millimetres = np.where(ranges == inf, 0, ranges * 1000).astype(np.uint16)
    stamps = np.arange(len(xs)) * 4.0
    np.savez(folder / f"{name}.npz", stamp=stamps, pose=poses, range_mm=millimetres, angle=ANGLES)
    (folder / f"{name}.doors.json").write_text(json.dumps(DOORS))
    return folder


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_document_counts_visits_by_truth(tmp_path: Path) -> None:
    log = PackedLog.read(packed(tmp_path / "set") / "tiny.npz")

    found = scores(log, Told(), seeds=2)

    assert {"OPEN": 4, "UNKNOWN": 0, "CLOSED": 0} == found["open"]
    assert {"OPEN": 0, "UNKNOWN": 0, "CLOSED": 4} == found["closed"]
    assert {"open": found["open"], "closed": found["closed"]} == found["plain_rule"]
    assert 0 == found["passed"] == found["wrong"] == found["undecided"]
    assert 0.98 < found["said_accuracy"] < 1
    assert found["ece"] == pytest.approx(1 - found["said_accuracy"], abs=1e-6)
    assert found["scans_per_s"] > 0
    assert 2 == found["virtual"]["seeds"]
    text = table({"tiny": found})
    assert "tiny: 60 scans" in text
    assert "virtual leaf ajar" in text


@pytest.mark.slow
def test_a_document_is_printed_with_null_for_what_is_no_number(tmp_path: Path) -> None:
    done = run(packed(tmp_path / "set"), "--json", "--seeds", "1")

    assert (0, "") == (done.returncode, done.stderr)
    figures = json.loads(done.stdout)["tiny"]
    assert {"open", "closed", "passed", "ece", "said_accuracy", "scans_per_s", "plain_rule"} <= set(
        figures
    )
    assert figures["virtual"]["wrong_se"] is None
    text = run(tmp_path / "set", "--seeds", "0")
    assert "driven through: 0" in text.stdout


@pytest.mark.slow
def test_folders_that_hold_no_logs_are_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    broken = packed(tmp_path / "broken")
    (broken / "tiny.npz").write_bytes(b"PK")
    odd = packed(tmp_path / "odd")
    (odd / "tiny.doors.json").write_text('[{"x": 1}]')
    ajar = packed(tmp_path / "ajar")
    (ajar / "tiny.doors.json").write_text(json.dumps([{**DOORS[0], "truth": "AJAR"}]))

    for folder, told in [
        (tmp_path / "empty", "expected a folder with NAME.npz and NAME.doors.json"),
        (broken, "expected arrays stamp, pose, range_mm, angle"),
        (odd, "expected doors with x, y, theta, width, truth"),
        (ajar, "expected a truth of"),
    ]:
        done = run(folder)
        assert (1, "") == (done.returncode, done.stdout)
        assert done.stderr.startswith("eval_scans: ")
        assert told in done.stderr
        assert "Traceback" not in done.stderr
    twice = run(packed(tmp_path / "one"), packed(tmp_path / "two"))
    assert "expected different names" in twice.stderr


def test_a_virtual_leaf_stops_the_beams_that_meet_it(tmp_path: Path) -> None:
    log = PackedLog.read(packed(tmp_path / "set") / "tiny.npz")

    day = VirtualDay.of(log, seed=3)
    again = VirtualDay.of(log, seed=3)

    assert (day.ranges <= log.ranges).all()
    assert (day.ranges < log.ranges - 0.1).any()
    assert (day.ranges == again.ranges).all()
    assert (VirtualDay.of(log, seed=4).ranges != day.ranges).any()
    assert {door for _, door in day.leaves} == {0}, "walls get no leaf"


def test_where_a_virtual_leaf_stands() -> None:
    line = np.array([0.0, 1.0, 0.0, WIDTH])
    ajar = VirtualLeaf("ajar", radians(60), at_end=True, side=1, recess=0.1)

    hinge, edge = ajar.segment(line)

    assert hinge == pytest.approx([WIDTH, 1.1])
    assert edge == pytest.approx([WIDTH / 2, 1.1 + WIDTH * cos(radians(30))])
    pose = np.array([[0.2, 0.0, np.pi / 2]])
    shut = VirtualLeaf("closed", 0.0, at_end=False, side=1, recess=0.0)
    assert ranges_to(pose, np.array([0.0, 1.5]), *shut.segment(line))[0].tolist() == [1.0, inf]


def visit(state: DoorState, p_open: float, *, through: float = 1, stopped: float = 0) -> Visit:
    return Visit(
        door_id=DoorId(1), first_ns=0, last_ns=1, scans=1, state=state, opening=0.5, ajar=0.0,
        accuracy=max(p_open, 1 - p_open), looks=1, through=through, stopped=stopped,
        behind_m=0.0, p_open=p_open,
    )  # fmt: skip


def test_figures_of_a_few_visits() -> None:
    visits = [
        Judged(visit(DoorState.OPEN, 0.9), "open"),
        Judged(visit(DoorState.OPEN, 0.94), "closed"),
        Judged(visit(DoorState.CLOSED, 0.1), "closed"),
        Judged(visit(DoorState.UNKNOWN, 0.4), "open"),
        Judged(visit(DoorState.OPEN, 0.9), "ajar"),
    ]

    assert {"OPEN": 1, "UNKNOWN": 1, "CLOSED": 0} == counts(visits, "open")
    assert wrong_share(visits) == pytest.approx(1 / 3)
    assert said_accuracy(visits) == pytest.approx((0.9 + 0.94 + 0.9) / 3)
    assert [1, 1, 2] == [b.visits for b in bins(visits)]
    assert ece(visits) == pytest.approx((0.1 + 0.6 + 2 * 0.42) / 4)


@pytest.mark.parametrize(
    ("through", "stopped", "word"),
    [(2, 1, "OPEN"), (1, 2, "CLOSED"), (1, 1, "CLOSED"), (0, 0, "UNKNOWN")],
)
def test_the_plain_rule_asks_for_more_than_half(through: int, stopped: int, word: str) -> None:
    assert word == plain_word(visit(DoorState.UNKNOWN, 0.5, through=through, stopped=stopped))
