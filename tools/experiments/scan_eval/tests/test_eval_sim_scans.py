"""The figures of `eval_sim_scans.py` and `eval_sim_week.py`: by hand, and the tools run."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from eval_sim_scans import scores
from patrol_sim.laser_judging import Judged

from semmap_log.core.model.doors import DoorId

TOOLS = Path(__file__).parents[2]
VISIT = Judged(
    pose="told", seed=1, door_id=DoorId(1), kind="hinged", glass=False, first_s=0.0, last_s=5.0,
    state="OPEN", accuracy=0.9, p_open=0.9, opening=1.0, looks=9.0, why="", passed=False,
    truly_passed=False, plain="OPEN", in_view=True, moved=False, group="open", towards=False,
    angle_deg=90.0, true_opening=1.0,
)  # fmt: skip
SHUT = replace(VISIT, state="CLOSED", p_open=0.1, plain="CLOSED", group="closed", angle_deg=0.0)


def test_shares_and_their_errors() -> None:
    """
    Two patrols, 3 of 4 and 1 of 2 right: 4 of 6, and the standard error of a ratio over patrols.
    """
    wrong = replace(VISIT, state="CLOSED", p_open=0.1)
    visits = [VISIT, VISIT, VISIT, wrong, replace(VISIT, seed=2), replace(wrong, seed=2)]

    row = scores(visits)["groups"]["open"]

    assert row["visits"] == 6
    share, error = row["estimator"]["OPEN"]
    assert share == pytest.approx(4 / 6)
    spread = (3 - 4 * 4 / 6) ** 2 + (1 - 2 * 4 / 6) ** 2
    assert error == pytest.approx(math.sqrt(spread * 2) / 6)
    assert row["plain_rule"]["OPEN"][0] == 1.0


def test_calibration_is_reckoned_over_open_and_shut() -> None:
    """Ten visits that said .9 of which eight were open: off by .1; their Brier score by hand."""
    visits = [VISIT] * 8 + [replace(VISIT, group="closed")] * 2 + [replace(VISIT, group="ajar")]

    found = scores(visits)

    assert found["ece"] == pytest.approx(0.1)
    assert found["brier"] == pytest.approx(0.8 * 0.01 + 0.2 * 0.81)
    assert found["decided"] == {"visits": 10, "said": pytest.approx(0.9), "was": 0.8}
    assert found["bins"] == [{"visits": 10, "said": pytest.approx(0.9), "was": pytest.approx(0.8)}]


def test_what_cannot_be_judged_is_left_out_and_counted() -> None:
    """Doors that moved meanwhile, that were hardly seen, of glass, or driven through."""
    visits = [
        VISIT, SHUT, replace(VISIT, moved=True, group="closed"),
        replace(VISIT, in_view=False, group="closed"), replace(SHUT, glass=True),
        replace(VISIT, passed=True, truly_passed=True), replace(VISIT, passed=True),
    ]  # fmt: skip

    found = scores(visits)

    assert found["moved"] == 1
    assert found["passed"] == {"right": 1, "wrong": 1}
    assert [found["groups"][group]["visits"] for group in ("open", "closed")] == [1, 1]
    assert found["glass"]["closed"]["visits"] == 1
    assert (found["hardly_in_view"]["visits"], found["hardly_in_view_wrong"]) == (1, 1)


def test_ajar_doors_are_told_by_their_leafs_side() -> None:
    ajar = replace(VISIT, group="ajar", angle_deg=30.0)

    found = scores([ajar, replace(ajar, towards=True), replace(ajar, towards=True), SHUT])

    assert found["ajar_towards"]["visits"] == 2
    assert found["ajar_away"]["visits"] == 1


def run(tool: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOLS / tool), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_scans_are_judged(tmp_path: Path, shared_data: Path) -> None:
    """One short patrol: three localisations of the same scans, a line for each visit."""
    lines = tmp_path / "visits.jsonl"
    done = run(
        "eval_sim_scans.py", "--seeds", "2", "--minutes", "1", "--hz", "4", "--json",
        "--visits", lines, "--maps", shared_data / "maps",
    )  # fmt: skip

    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert list(found) == ["5 cm, 1 deg, told", "10 cm, 2 deg, told", "20 cm, 4 deg, not told"]
    told = [json.loads(line) for line in lines.read_text().splitlines()]
    assert sum(score["visits"] for score in found.values()) == len(told)


@pytest.mark.slow
def test_week_is_learnt_twice(shared_data: Path) -> None:
    """One week with half a minute of driving a round: four Brier scores between 0 and 1."""
    done = run(
        "eval_sim_week.py", "--seeds", "1", "--minutes", "0.5", "--hz", "1", "--json",
        "--maps", shared_data / "maps",
    )  # fmt: skip

    assert done.returncode == 0, done.stderr
    [week] = json.loads(done.stdout)
    assert 0 < week["decided"] <= week["visits"]
    for what in ("live", "habit"):
        assert set(week[what]) == {"scans", "truth"}
        assert all(0 < score < 0.5 for score in week[what].values())
