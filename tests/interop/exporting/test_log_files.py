"""Files for other programs: what the thesis's server loads, and never half of it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import semmap_log as sl
from semmap_log.errors import OutputError
from semmap_log.interop.exporting.log_files import export


def test_the_yaml_is_the_thesis_schema(tmp_path: Path) -> None:
    """Fig. 4.1: keys are ids, ascending; all values but the status are real numbers."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(door_id=sl.DoorId(7), x=1.5, y=-2.0, theta=0.1, width=0.9, state="moving")
        log.add_door(
            door_id=sl.DoorId(3), x=0, y=0, theta=0, width=1, state="open", prob_open=1 / 3
        )
        log.add_door(name="contact without a place")
        done = export(log, tmp_path / "doors.yaml", default_prob=0.5)

    loaded = yaml.safe_load((tmp_path / "doors.yaml").read_text())

    assert [3, 7] == list(loaded)
    assert {
        "position": {"x": 1.5, "y": -2.0, "theta": 0.1},
        "width": 0.9,
        "status": "UNKNOWN",
        "closed_prob": 0.5,
        "open_prob": 0.5,
    } == loaded[7]
    assert (1 / 3, 0.5, "OPEN") == tuple(
        loaded[3][k] for k in ("open_prob", "closed_prob", "status")
    )
    assert any("contact without a place" in text for text in done.left_out)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["doors.yaml", "states.csv", "events.jsonl", "a.geojson", "a.pddl"]
)
def test_a_full_disk_leaves_the_old_file_whole(name: str, tmp_path: Path) -> None:
    """No half file, no litter, one clear error."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for n in range(50):
            log.add_door(x=n, y=0, theta=0, width=1, state="open", prob_open=0.5, prob_closed=0.5)
    (tmp_path / name).write_text("old")
    code = """
import resource, sys, semmap_log as sl
from pathlib import Path
from semmap_log.errors import OutputError
from semmap_log.interop.exporting.log_files import export
log = sl.read(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500))
try:
    export(log, Path(sys.argv[2]))
except OutputError as error:
    print(error)
"""
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "log", tmp_path / name],
        capture_output=True,
        text=True,
        check=True,
    )

    assert f"{name}: could not be written" in done.stdout
    assert "old" == (tmp_path / name).read_text()
    assert sorted([name, "log"]) == sorted(p.name for p in tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    """As one error of ours, with the path."""
    with sl.create(tmp_path / "log", tz="UTC") as log, pytest.raises(OutputError, match="nowhere"):
        export(log, tmp_path / "nowhere" / "events.jsonl")
