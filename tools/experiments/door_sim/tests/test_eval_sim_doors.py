"""`eval_sim_doors.py`: its doors' chances are exact, its document says what it promises."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from patrol_sim.habits import HOUR_NS

from door_sim.kinds import KINDS
from door_sim.week_chain import MONDAY_NS

TOOL = Path(__file__).parents[2] / "eval_sim_doors.py"
WEEKS = 150


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "flicker"])
def test_a_door_lives_by_its_chances(kind: str) -> None:
    """
    Over 150 weeks, each quarter of an hour of the week: as often open as is said, and the waits
    are those that are said.
    """
    rng = np.random.default_rng(1)
    chain = KINDS[kind](rng)
    life = chain.life(rng, WEEKS)
    times = MONDAY_NS + (np.arange(WEEKS * 168 * 4) * HOUR_NS) // 4 + HOUR_NS // 8
    place = np.searchsorted(life.start_ns, times, "right") - 1
    is_open = life.is_open[place]

    p_open = chain.p_open(times[: 168 * 4])
    often = is_open.reshape(WEEKS, -1).mean(0)
    before_last = times < life.start_ns[-1]
    came_h = np.where(is_open, 0, (life.end_ns[place] - times) / HOUR_NS)[before_last].mean()
    said_h = chain.wait_h(times[before_last], is_open[before_last]).mean()

    assert abs((often - p_open).mean()) < 0.05
    assert np.abs(often - p_open).mean() < 0.06
    assert came_h == pytest.approx(said_h, rel=0.25)


@pytest.mark.slow
def test_the_document_has_the_promised_form() -> None:
    """
    A row for each kind of door, number of weeks and way of seeing it; the same at each run.
    """
    asked = ("--only", "wait", "--only", "best", "--weeks", "2", "--seeds", "2", "--json")

    done, again = run(*asked), run(*asked)

    rows = json.loads(done.stdout)
    assert 0 == done.returncode, done.stderr
    assert done.stdout == again.stdout
    assert 2 * 2 * len(KINDS) == len(rows)
    assert {"known", "patrol"} == {row["seen"] for row in rows}
    assert {"said / was", "within 25%", "in interval"} <= rows[0].keys()
    assert all(0 <= row["lost, mean"] <= 1 for row in rows if row["question"] == "best")
