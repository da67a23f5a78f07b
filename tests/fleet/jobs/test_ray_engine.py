"""The same answers on Ray, where it is installed: its cluster is this machine's."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import EngineError
from tests.fleet.jobs.projections import Sightings

ROOT = Path(__file__).parents[3]
PROGRAM = """
import json, sys
import semmap_log as sl
from tests.fleet.jobs.projections import KillsItsWorker, KillsOnce

*logs, poison, mark, results = sys.argv[1:]
with sl.fleet([*logs, poison], engine="ray", workers=2, results=results) as fleet:
    killed = fleet.fold(KillsItsWorker(4))
    once = fleet.fold(KillsOnce(mark))
    openings = fleet.openings()
print(json.dumps([
    [[log.place, log.outcome.value] for log in killed.bad],
    [[place, sorted(state.items())] for place, state in killed.states.items()],
    len(once.bad),
    str(openings.table.drop_columns("log").to_pydict()),
]))
"""


@pytest.mark.slow
def test_answers_are_equal_and_only_the_one_that_kills_is_blamed(
    made_fleet: Path, tmp_path: Path
) -> None:
    """A worker that is killed once takes nothing along."""
    pytest.importorskip("ray")
    poison = tmp_path / "poison"
    with sl.create(poison, tz="UTC") as log:
        for n in range(4):
            log.observe(log.add_door(x=float(n), y=0.0, theta=0.0, width=1.0), "open")
    logs = [made_fleet / f"tug{n}" for n in range(3)]
    serial = sl.fleet([*logs, poison], engine="serial")
    states, openings = serial.fold(Sightings()).states, serial.openings()

    home = {"HOME": str(tmp_path), "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *logs, poison, tmp_path / "mark", tmp_path / "r"],
        env=os.environ | home, capture_output=True, text=True, check=False,
    )  # fmt: skip

    assert 0 == done.returncode, done.stderr
    bad, folded, others, table = json.loads(done.stdout.splitlines()[-1])
    assert [[str(poison), "worker died"]] == bad
    del states[str(poison)]
    assert [
        [place, [list(p) for p in sorted(state.items())]] for place, state in states.items()
    ] == (folded)
    assert 0 == others
    assert str(openings.table.drop_columns("log").to_pydict()) == table


def test_without_ray_it_says_how_to_get_it(
    made_fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)

    with pytest.raises(EngineError, match="pip install ray"):
        sl.fleet(made_fleet, engine="ray").map()
