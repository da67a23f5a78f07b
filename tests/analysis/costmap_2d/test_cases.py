"""What ROS's own costmap_2d made of the same doors: 175 cases, equal in every cell."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from check_costmap import check

CASES = Path(__file__).parent / "cases"
TOOL = Path(__file__).parents[3] / "tools" / "check_costmap.py"


def test_every_cell_of_every_case() -> None:
    """By full redraw and by incremental update, static map and inflation included."""
    checked = check(CASES)

    assert [] == checked.differences
    assert (175, 340, 1_279_156) == (checked.cases, checked.frames, checked.cells)
    assert 2 == checked.noetic_cells


def _run(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, TOOL, folder, *more], capture_output=True, text=True, check=False
    )


def test_the_tool_notices_a_cell(tmp_path: Path) -> None:
    """One cell of an expected master is another: it is counted in both ways of drawing."""
    cases = json.loads((CASES / "cases.json").read_text(encoding="utf-8"))[:3]
    with np.load(CASES / "cases.npz") as grids:
        kept = {
            name: grids[name] for name in grids if name.split("_")[0] in {"c000", "c001", "c002"}
        }
    (tmp_path / "cases.json").write_text(json.dumps(cases), encoding="utf-8")
    kept["c001_master"][0, 4, 5] ^= 1
    np.savez(tmp_path / "cases.npz", **kept)

    done, said = _run(tmp_path), _run(tmp_path, "--json")

    assert 1 == done.returncode
    assert "redraw: 1 cells differ" in done.stdout
    assert "3 cases, 3 frames" in done.stdout
    assert 2 == json.loads(said.stdout)["differing"]


@pytest.mark.parametrize(
    ("name", "text"),
    [("cases.json", "{}"), ("cases.json", "[1]"), ("cases.json", "["), ("cases.npz", "no")],
)
def test_what_is_no_pack_is_an_error(name: str, text: str, tmp_path: Path) -> None:
    """Exit code 2, and no traceback."""
    for file in ("cases.json", "cases.npz"):
        shutil.copy(CASES / file, tmp_path / file)
    (tmp_path / name).write_text(text, encoding="utf-8")

    done = _run(tmp_path)

    if text == "{}":  # no cases: nothing differs
        assert (0, "") == (done.returncode, done.stderr)
    else:
        assert (2, "") == (done.returncode, done.stdout)
        assert "not a pack of cases" in done.stderr
        assert "Traceback" not in done.stderr
