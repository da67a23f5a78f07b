"""Pictures of visits: what is drawn, asked of matplotlib itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="not installed: pip install 'semmap-log[plots]'")

from semmap_log.analysis.scans.door_figures import door_figures
from semmap_log.analysis.scans.visit import KeptVisit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.views.palette import COLOUR_BLIND, DEFAULT, Palette
from semmap_log.views.plots.sighting_panels import (
    MOST_BEAMS,
    MOST_DOORS,
    DoorPictures,
    draw_sightings,
    plot_sightings,
)
from tests.analysis.scans.some_scans import LINE, SHUT, seen_visit


def _pictures(label: str = "front", visits: int = 2, **other: object) -> DoorPictures:
    kept = []
    for n in range(visits):
        visit, scans = seen_visit(30 * n, leaf=None if n % 2 else SHUT, **other)
        kept.append(KeptVisit(visit, 0, LINE, tuple(scans)))
    (figures,) = door_figures([one.visit for one in kept])
    return DoorPictures(label, figures, kept)


def _words(figure: object) -> list[str]:
    found = [text.get_text() for text in figure.texts]  # type: ignore[attr-defined]
    for panel in figure.axes:  # type: ignore[attr-defined]
        found += [text.get_text() for text in panel.texts]
    return found


@pytest.mark.parametrize("palette", [DEFAULT, COLOUR_BLIND], ids=["default", "colour-blind"])
def test_a_picture_shows_line_leaf_beams_and_the_way(palette: Palette) -> None:
    """The leaf in the colour of what is said, on the door's line if it is shut."""
    shut, wide = draw_sightings([_pictures()], tz="UTC", palette=palette).axes

    beams, leaf = shut.collections
    np.testing.assert_allclose(leaf.get_segments(), [[[0, 0], [1, 0]]], atol=1e-9)
    np.testing.assert_allclose(leaf.get_color()[0][:3], np.array(palette.closed) / 255)
    assert wide.collections[1].get_segments() == []
    assert 20 < len(beams.get_segments()) <= MOST_BEAMS
    lines = {line.get_color(): line.get_xydata() for line in shut.lines if len(line.get_xydata())}
    stopped = lines[tuple(part / 255 for part in palette.closed)]
    np.testing.assert_allclose(stopped[:, 1], 0.0, atol=1e-9)
    assert len(stopped) > 20
    np.testing.assert_allclose(lines["black"], [[0, 0], [1, 0]])
    through = tuple(part / 255 for part in palette.open)
    assert through not in lines
    assert any(line.get_color() == through and len(line.get_xydata()) for line in wide.lines)


@pytest.mark.parametrize("visits", [1, 2, 3, 4, 6])
def test_the_key_has_room_in_pictures_of_any_width(visits: int) -> None:
    """Whole, below the pictures of visits and above the note."""
    figure = draw_sightings([_pictures(visits=visits)], tz="UTC")

    figure.draw_without_rendering()
    key, note = figure.legends[0].get_window_extent(), figure.texts[-1].get_window_extent()
    assert 0 <= key.x0 < key.x1 <= figure.bbox.x1
    assert 0 <= note.y0 < note.y1 <= key.y0
    assert key.y1 < min(panel.get_window_extent().y0 for panel in figure.axes)


def test_words_tell_the_door_its_figures_and_each_visit() -> None:
    """And a key tells what the colours mean."""
    figure = draw_sightings([_pictures(behind_m=0.1)], tz="Europe/Vienna")

    words = _words(figure)
    assert {"front", "CLOSED .98", "OPEN .98", "2025-12-29 10:20:04"} <= set(words)
    assert (
        "2 visits: 1 OPEN, 1 CLOSED, 0 undecided; beams near its line end 0.10 m behind it" in words
    )
    key = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(key) == 8
    assert "beam went through the line" in key


def test_each_door_has_its_row_and_none_lies_on_another() -> None:
    """Whatever the number of their visits."""
    doors = [_pictures(f"door {n}", visits) for n, visits in enumerate((6, 1, 8))]

    figure = draw_sightings(doors, tz="UTC")

    assert len(figure.axes) == 15
    boxes = [panel.get_position() for panel in figure.axes]
    for n, box in enumerate(boxes):
        assert 0 <= box.x0 < box.x1 <= 1
        assert 0 < box.y0 < box.y1 <= 1
        for other in boxes[:n]:
            apart = box.x0 >= other.x1 or box.x1 <= other.x0
            assert apart or box.y1 <= other.y0 or box.y0 >= other.y1


def test_of_many_doors_the_first_are_drawn_and_it_is_said() -> None:
    """A picture has an end."""
    figure = draw_sightings([_pictures(f"d{n}", 1) for n in range(MOST_DOORS + 3)], tz="UTC")

    assert len(figure.axes) == MOST_DOORS
    assert any("3 doors more not drawn" in words for words in _words(figure))


@pytest.mark.slow
def test_the_same_visits_are_the_same_file(tmp_path: Path) -> None:
    """No time, no random names in it."""
    for name in ("a.svg", "b.svg", "a.png", "b.png"):
        plot_sightings([_pictures()], tmp_path / name, tz="UTC")

    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.filterwarnings("ignore:Glyph")
@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("\U00013000", "door 1"),
        ("\x1b[31mred\x07", r"\x1b[31mred\x07"),
        ("a $x$ b", r"a \$x\$ b"),
        ("会議室", "会議室"),
    ],
    ids=["hieroglyph", "escape", "formula", "CJK"],
)
def test_doors_may_be_called_anything(name: str, shown: str) -> None:
    """No formula is set, no sign steers anything; a name without shapes gives way to the number."""
    figure = draw_sightings([_pictures(name)], tz="UTC", letters=lambda c: c < "\U00010000")

    assert _words(figure)[0] == shown
    figure.canvas.draw()


def test_a_reason_from_outside_is_cut_and_steers_nothing() -> None:
    """It is read from a file."""
    door = _pictures(visits=1)
    visit = replace(door.visits[0].visit, state=DoorState.UNKNOWN, why="\x1b[2J" + "x" * 500)
    door = replace(door, visits=[replace(door.visits[0], visit=visit)])

    words = _words(draw_sightings([door], tz="UTC"))

    assert max(map(len, words)) < 130
    assert not any("\x1b" in said for said in words)


def test_a_door_that_was_only_driven_through_has_its_head_alone() -> None:
    """There is no scan to be drawn."""
    (figures,) = door_figures([seen_visit(passed=True)[0]])

    figure = draw_sightings(
        [DoorPictures("front", replace(figures, door_id=DoorId(4)), [])], tz="UTC"
    )

    assert figure.axes == []
    assert any("1 driven through" in said for said in _words(figure))
