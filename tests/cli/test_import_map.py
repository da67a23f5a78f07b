"""`import` of a map_server map: a floor plan, once, on the level that is meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import semmap_log as sl
from semmap_log.core.model.events import FloorMap, LevelAdded
from tests.verbs import run

MAP = """image: m.{ending}
resolution: 0.1
origin: [-1.0, -2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A map beside a new log."""
    monkeypatch.chdir(tmp_path)
    draw()
    with sl.create("office", tz="UTC"):
        pass
    return tmp_path


def draw(ending: str = "pgm", grey: int = 254) -> None:
    picture = np.full((3, 4), grey, np.uint8)
    picture[0, 0] = 0
    Image.fromarray(picture).save(f"m.{ending}")
    Path("m.yaml").write_text(MAP.format(ending=ending))


def maps() -> list[FloorMap]:
    batches = sl.read("office").batches(kinds=[FloorMap])
    return [e for batch in batches for e in batch.to_events() if isinstance(e, FloorMap)]


@pytest.mark.parametrize("ending", ["pgm", "png"])
def test_it_is_the_floor_plan(here: Path, ending: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The same cells as `init --map` makes; the file again changes nothing."""
    draw(ending)
    assert 0 == run("init", "other", "--map", "m.yaml")
    capsys.readouterr()

    assert 0 == run("import", "office", "m.yaml")
    told = capsys.readouterr().out
    assert 0 == run("import", "office", "m.yaml")

    (found,) = maps()
    expected = sl.read("other").floor_map()
    assert expected is not None
    assert np.array_equal(expected.cells, found.cells)
    assert (0, -1.0, -2.0) == (found.level, found.origin_x, found.origin_y)
    assert "floor plan of level 0: 4 x 3 cells of 0.1 m" in told
    assert "imported before; nothing to do" in capsys.readouterr().out


def test_what_init_took_in_is_there_already(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One code path; read in another way, it is another map, if its cells are others."""
    assert 0 == run("init", "new", "--map", "m.yaml")
    capsys.readouterr()
    before = sl.read("new").replay().event

    assert 0 == run("import", "new", "m.yaml")
    assert 0 == run("import", "new", "m.yaml", "--map-rules", "noetic")

    told = capsys.readouterr().out.splitlines()
    assert ["m.yaml: the log holds all of it already; nothing to do."] * 2 == told
    assert before == sl.read("new").replay().event


def test_another_picture_is_another_map(here: Path) -> None:
    """Though the .yaml is the same, byte for byte."""
    for grey in (254, 100):
        draw(grey=grey)
        assert 0 == run("import", "office", "m.yaml")

    assert [0, -1] == [int(found.cells[0, 3]) for found in maps()]


def test_the_level_is_inferred_or_asked_for(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One: that. Several: an error that names them and the option."""
    with sl.append("office") as log:
        log.append([LevelAdded(level=1, name="L1")])
    assert 0 == run("import", "office", "m.yaml")
    assert "floor plan of level L1" in capsys.readouterr().out
    with sl.append("office") as log:
        log.append([LevelAdded(level=2, name="L2")])
    draw(grey=100)

    assert 1 == run("import", "office", "m.yaml")
    said = capsys.readouterr().err
    assert 0 == run("import", "office", "m.yaml", "--level", "L2")

    assert "several levels: 1 (L1), 2 (L2); say which one: --level L" in said
    assert [1, 2] == [found.level for found in maps()]


def test_a_map_that_is_none_makes_nothing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The line that is wrong is named; `init` leaves no log behind."""
    Path("m.pgm").unlink()

    assert 1 == run("import", "office", "m.yaml")
    assert "m.yaml:1: image:" in capsys.readouterr().err
    assert 1 == run("init", "new", "--map", "m.yaml")
    assert not Path("new").exists()
    assert [] == maps()


def test_rules_are_of_maps_only(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A thesis YAML has no pixels."""
    Path("doors.yaml").write_text("{}\n")

    assert 1 == run("import", "office", "doors.yaml", "--map-rules", "noetic")
    assert "is only for maps" in capsys.readouterr().err
