"""Floor plans that were there before they were imported: what asks about the past uses them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at
from semmap_log.analysis.planning.door_trip import door_trip
from semmap_log.analysis.rooms.level_rooms import rooms_of
from semmap_log.cli import main
from semmap_log.interop.importing.importing import ImportOptions, import_file

NOW_NS = 1_780_000_000 * 10**9
JANUARY, MARCH = "2026-01-01", "2026-03-02"


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    """Two rooms of 2 m x 2 m, with a gap of 1 m between them where the door is."""
    cells = np.full((44, 86), 254, np.uint8)
    cells[[0, 1, -2, -1], :] = cells[:, [0, 1, -2, -1]] = 0
    cells[:, 42:44] = 0
    cells[12:32, 42:44] = 254
    Image.fromarray(cells).save(tmp_path / "m.pgm")
    (tmp_path / "map.yaml").write_text(
        "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return tmp_path / "map.yaml"


@pytest.fixture
def log(tmp_path: Path) -> sl.DoorLogWriter:
    made = sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(NOW_NS))
    made.add_door(x=2.15, y=0.6, theta=np.pi / 2, width=1.0, name="gap", at=JANUARY)
    return made


def _since(log: sl.DoorLog, text: str) -> int:
    return log.moment(text).ns or 0


def test_a_plan_of_the_past_is_used_by_what_asks_about_the_past(
    log: sl.DoorLogWriter, plan: Path
) -> None:
    """Rooms, trips, costmaps; before it nothing is there, as it was."""
    import_file(log, plan)
    assert not rooms_of(log, at=MARCH).rooms
    before = door_trip(log, "1,1", "3,1", depart=MARCH)
    assert "level 0 has no floor plan then, only from 2026-05-28 20:26:40" in before.notes[0]
    with pytest.raises(sl.errors.PlanError, match=r"no floor plan then, only from .*: no rooms"):
        door_trip(log, "room 1", "3,1", depart=MARCH)

    import_file(log, plan, ImportOptions(since_ns=_since(log, "2026-02-01")))

    assert 2 == len(rooms_of(log, at=MARCH).rooms)
    assert not rooms_of(log, at=JANUARY).rooms
    notes = door_trip(log, "1,1", "3,1", depart=MARCH).notes
    assert not any("floor plan" in note for note in notes)
    assert (44, 86) == costmap_at(log, CostmapOptions(), at=MARCH).geometry.shape


def test_a_plan_that_was_there_already_is_held(log: sl.DoorLogWriter, plan: Path) -> None:
    """From then on, or from earlier."""
    options = [ImportOptions(since_ns=_since(log, day)) for day in ("2026-02-01", "2026-02-03")]

    assert [1, 0] == [import_file(log, plan, each).plan.count for each in options]
    assert 0 == import_file(log, plan).plan.count


def test_init_takes_a_plan_of_the_past(
    tmp_path: Path, plan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And leaves nothing where the time is none."""

    def init(*words: str) -> object:
        with pytest.raises(SystemExit) as left:
            main(["init", str(tmp_path / "new"), "--tz", "UTC", *words])
        return left.value.code

    assert 1 == init("--map", str(plan), "--since", "2236-01-01")
    assert 1 == init("--map", str(plan), "--since", "event:3")
    assert 2 == init("--since", JANUARY)
    assert not (tmp_path / "new").exists()
    capsys.readouterr()
    assert 0 == init("--map", str(plan), "--since", JANUARY)
    assert 2 == len(rooms_of(sl.read(tmp_path / "new"), at=MARCH).rooms) + 1
