"""`eval_proposals.py`: its figures by hand, of a packed log, of a small simulation."""

from __future__ import annotations

import json
import subprocess
import sys
from math import nan, pi, sqrt
from pathlib import Path

import pytest
from eval_proposals import of_log, table
from patrol_sim.tests.corridor import patrol

from scan_eval.packed_logs import PackedLog
from scan_eval.proposal_scores import Doorway, Drive, figures
from scan_eval.ratios import ratio
from scan_eval.simulated_drives import seen_on
from scan_eval.tests.test_eval_scans import packed
from semmap_log.analysis.scans.proposing.proposals import Proposal

TOOL = Path(__file__).parents[2] / "eval_proposals.py"


def _proposal(x: float, *, width: float = 1.0, theta: float = 0.0) -> Proposal:
    """Return one whose line begins at (x, 0)."""
    return Proposal(
        0, x, 0.0, theta, width, "opening", score=1.0, walls=1.0, along=1.0, free=1.0, opens=1.0,
        scans=1, visits=1, seen_open=1, seen_closed=0, seen_ajar=0, passed=0,
    )  # fmt: skip


def test_each_doorway_is_found_once_by_the_nearest() -> None:
    """
    A second proposal at the same doorway, one that is turned, and one elsewhere are others.
    """
    doorway = Doorway(0.0, 0.0, 0.0, 1.0)
    near, beside, far = _proposal(0.1, width=0.8), _proposal(0.4), _proposal(3.0)
    across = _proposal(0.5, theta=pi / 2)

    found = figures([Drive([doorway], [far, beside, near, across])])

    assert (found["found"], found["others"], found["recall"][0]) == (1, 3, 1.0)
    assert found["width_m"][0] == pytest.approx(-0.2)
    assert found["centre_m"][0] == pytest.approx(0.0)


def test_a_line_drawn_from_the_other_end_is_the_same_doorway() -> None:
    drive = Drive([Doorway(1.0, 0.0, pi, 1.0)], [_proposal(0.0)])

    assert figures([drive])["found"] == 1
    assert figures([drive])["angle_deg"][0] == pytest.approx(0.0)


def test_what_no_beam_went_through_does_not_count_as_missed() -> None:
    """
    Shut all the time; it is told apart.
    """
    shut = Doorway(5.0, 0.0, 0.0, 1.0, is_seen=False)

    found = figures([Drive([Doorway(0.0, 0.0, 0.0, 1.0), shut], [_proposal(0.0)])])

    assert (found["doorways"], found["seen"], found["seen_found"]) == (2, 1, 1)
    assert found["recall"][0] == 1.0


def test_errors_of_shares_are_over_drives() -> None:
    """
    3 of 4 and 1 of 2: the standard error of a ratio; of one drive none is known.
    """
    share, error = ratio([3, 1], [4, 2])

    assert share == pytest.approx(4 / 6)
    assert error == pytest.approx(sqrt(((3 - 4 * share) ** 2 + (1 - 2 * share) ** 2) * 2) / 6)
    assert ratio([1], [2]) == (0.5, pytest.approx(nan, nan_ok=True))
    assert ratio([0], [0]) == pytest.approx((nan, nan), nan_ok=True)


def test_a_packed_log_is_judged_by_its_open_doors(tmp_path: Path) -> None:
    found = of_log(PackedLog.read(packed(tmp_path / "set") / "tiny.npz"))

    assert (found["doorways"], found["found"], found["others"]) == (1, 1, 0)
    assert abs(found["width_m"][0]) < 0.1
    assert "found 1 of 1 doorways" in table({"tiny": found})


def test_a_simulated_patrol_is_judged_with_a_floor_plan_and_without() -> None:
    """
    Doors that beams went through are found, about as wide as they are.
    """
    seen = seen_on(patrol())

    for drive in (seen.with_plan, seen.without):
        found = figures([drive])
        assert found["doorways"] == 3
        assert (found["seen"], found["seen_found"]) == (3, 2)
        assert abs(found["width_m"][0]) < 0.12


@pytest.mark.slow
def test_a_document_is_printed_with_null_for_what_is_no_number(tmp_path: Path) -> None:
    command = [sys.executable, str(TOOL), str(packed(tmp_path / "set")), "--json"]

    done = subprocess.run(command, capture_output=True, text=True, check=False)

    assert (0, "") == (done.returncode, done.stderr)
    assert json.loads(done.stdout)["tiny"]["recall"] == [1.0, None]


@pytest.mark.slow
def test_a_folder_without_logs_is_refused(tmp_path: Path) -> None:
    for arguments, code, words in (([str(tmp_path)], 1, "NAME.npz"), ([], 2, "expected a FOLDER")):
        done = subprocess.run([sys.executable, str(TOOL), *arguments], capture_output=True,
                              text=True, check=False)  # fmt: skip
        assert (code, True) == (done.returncode, words in done.stderr)
