"""Visits to doors as a grid of small pictures: beams, the door's line, the fitted leaf."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from semmap_log.analysis.scans.door_figures import DoorFigures
from semmap_log.analysis.scans.visit import KeptVisit
from semmap_log.core.texts import counted
from semmap_log.views.event_words import HasShape, drawable_name, printable
from semmap_log.views.palette import (
    DEFAULT,
    PLOT_BEAM,
    PLOT_BEAM_ASIDE,
    PLOT_BEAM_LOST,
    PLOT_BEAM_SHORT,
    PLOT_GRID,
    PLOT_LEAF,
    PLOT_WORDS,
    Palette,
    Rgb,
)
from semmap_log.views.plots.figures import (
    Line2D,
    LineCollection,
    has_shape,
    letters_of,
    new_figure,
    save_figure,
)
from semmap_log.views.sightings.visit_words import (
    DoorScene,
    Fate,
    Points,
    door_scene,
    grounds,
    verdict,
    when,
)

PANEL_IN, WORDS_IN, GAP_IN = 2.3, 0.62, 0.12
"""Side of a picture; height of the words above it; room between pictures."""
HEAD_IN, EDGE_IN = 0.55, 0.3
"""Of a door's name and figures; around all."""
KEY_COLUMN_IN, KEY_ROW_IN, NOTE_IN = 2.45, 0.19, 0.4
"""Of the key: a sign with its words; below it a note."""
SIGNS = 8
"""How many the key has."""
COLUMNS = 6
MOST_OF_ONE, MOST_OF_EACH = 24, 6
"""Visits that are drawn of a single door, and of each of several."""
MOST_DOORS = 40
AROUND_M = 1.6
"""What is shown around a door, beyond its width."""
MOST_BEAMS = 80
"""So many lines of beams are drawn in a picture; more would be one area."""
WORD_LETTERS, SMALL_LETTERS, BIG_LETTERS = 50, 33, 22
"""Letters in a line above a picture; fewer are drawn larger."""
_LOOK = {
    Fate.aside: (PLOT_BEAM_ASIDE, 1.2),
    Fate.short: (PLOT_BEAM_SHORT, 3.0),
    Fate.lost: (PLOT_BEAM_LOST, 3.5),
}
"""Colour and size, points, of where beams ended; the others have those of the states."""


@dataclass(frozen=True, slots=True)
class DoorPictures:
    """What is drawn of a door."""

    label: str
    figures: DoorFigures
    visits: Sequence[KeptVisit]
    """Those that are drawn, with their scans."""


def plot_sightings(
    doors: Sequence[DoorPictures], path: Path, *, tz: str, palette: Palette = DEFAULT
) -> None:
    """Draw the visits to doors into a .png or .svg.

    Args:
        doors: At least one; of more than `MOST_DOORS` the first are drawn.
        path: The file; what is there is replaced once the new one is whole.
        tz: The zone of the times.
        palette: Colours of states.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    save_figure(draw_sightings(doors, tz=tz, palette=palette, letters=letters_of(path)), path)


def draw_sightings(
    doors: Sequence[DoorPictures],
    *,
    tz: str,
    palette: Palette = DEFAULT,
    letters: HasShape = has_shape,
) -> Any:
    """Return the figure; a door whose name has a letter without a shape is shown by its id."""
    shown = doors[:MOST_DOORS]
    columns = min(COLUMNS, max(2, *(len(door.visits) for door in shown), 0))
    rows = [math.ceil(len(door.visits) / columns) for door in shown]
    width = columns * (PANEL_IN + GAP_IN) - GAP_IN + 2 * EDGE_IN
    foot = NOTE_IN + math.ceil(SIGNS / _key_columns(width)) * KEY_ROW_IN
    height = sum(HEAD_IN + n * _ROW_IN for n in rows) + foot + EDGE_IN
    sheet = _Sheet(new_figure(width, height), width, height)
    top = height - EDGE_IN
    for door, n in zip(shown, rows, strict=True):
        sheet.head(top, _name(door, letters), _figures(door))
        for place, kept in enumerate(door.visits):
            row, column = divmod(place, columns)
            panel = sheet.panel(top - HEAD_IN - (row + 1) * _ROW_IN, column)
            _draw(panel, kept, tz, palette)
        top -= HEAD_IN + n * _ROW_IN
    sheet.foot(palette, len(doors) - len(shown))
    return sheet.figure


_ROW_IN = PANEL_IN + WORDS_IN


def _key_columns(width: float) -> int:
    """Return how many columns of signs there is room for, in a figure of a width."""
    return max(1, int((width - 2 * EDGE_IN) / KEY_COLUMN_IN))


@dataclass(frozen=True, slots=True)
class _Sheet:
    """A figure with places in inches, from its lower left corner."""

    figure: Any
    width: float
    height: float

    def head(self, top: float, name: str, figures: str) -> None:
        """Write a door's name and figures below `top`."""
        left = EDGE_IN / self.width
        self.figure.text(left, (top - 0.14) / self.height, name, va="top", fontweight="bold",
                         fontsize=11)  # fmt: skip
        self.figure.text(left, (top - 0.36) / self.height, figures, va="top", fontsize=8.5)

    def panel(self, bottom: float, column: int) -> Any:
        """Return a picture with the given lower edge."""
        left = EDGE_IN + column * (PANEL_IN + GAP_IN)
        return self.figure.add_axes((left / self.width, bottom / self.height,
                                     PANEL_IN / self.width, PANEL_IN / self.height))  # fmt: skip

    def foot(self, palette: Palette, doors_left_out: int) -> None:
        """Write what the colours mean."""
        more = f"; {counted(doors_left_out, 'door')} more not drawn" if doors_left_out else ""
        self.figure.legend(
            handles=list(_key(palette)), loc="lower left", ncols=_key_columns(self.width),
            fontsize=8, frameon=False, bbox_to_anchor=(EDGE_IN / self.width, 0.28 / self.height),
            borderaxespad=0, borderpad=0, handlelength=1.6, columnspacing=1.2, labelspacing=0.4,
        )  # fmt: skip
        self.figure.text(
            EDGE_IN / self.width, 0.08 / self.height,
            f"the door's line lies across, its left side above; a tick is 1 m{more}",
            fontsize=7.5, va="bottom",
        )  # fmt: skip


def _draw(panel: Any, kept: KeptVisit, tz: str, palette: Palette) -> None:
    scene = door_scene(kept)
    _frame(panel, scene)
    _draw_beams(panel, scene, palette)
    panel.plot(*scene.track.T, "-", color=_part(palette.robot), linewidth=2.0, zorder=4)
    panel.plot(*scene.track[-1:].T, "o", color=_part(palette.robot), markersize=5, zorder=4)
    panel.plot([0, scene.width], [0, 0], "-", color="black", linewidth=1.0, zorder=5)
    panel.plot([0, scene.width], [0, 0], "|", color="black", markersize=9, zorder=5)
    colour = _part(palette.of_state(kept.visit.state))
    panel.add_collection(
        LineCollection(list(scene.leaves.reshape(-1, 2, 2)), colors=[colour], linewidths=4.0,
                       alpha=0.85, capstyle="round", zorder=6)
    )  # fmt: skip
    _write(panel, kept, tz, palette)


def _write(panel: Any, kept: KeptVisit, tz: str, palette: Palette) -> None:
    """Write the verdict, its time and its grounds above a picture."""
    said, visit = verdict(kept.visit), kept.visit
    text = _part(palette.text_of_state(visit.state))
    lines: list[tuple[str, float, float, dict[str, Any]]] = [
        (said, 0.34, _size(said), {"color": text, "weight": "bold"}),
        (when(visit, tz), 0.18, 8, {"color": "black"}),
        (grounds(visit), 0.04, 6.2, {"color": PLOT_WORDS}),
    ]
    for line, above_in, size, look in lines:
        panel.text(0, 1 + above_in / PANEL_IN, printable(_short(line)), fontsize=size,
                   transform=panel.transAxes, **look)  # fmt: skip


def _size(verdict: str) -> float:
    """Return the size of a verdict, points, so that it does not reach the next one."""
    letters = len(verdict)
    return 9.5 if letters < BIG_LETTERS else 7.5 if letters < SMALL_LETTERS else 5.8


def _frame(panel: Any, scene: DoorScene) -> None:
    """Show the same square around a door in all of its pictures."""
    half = scene.width / 2 + AROUND_M
    panel.set(xlim=(scene.width / 2 - half, scene.width / 2 + half), ylim=(-half, half))
    ticks = np.arange(math.ceil(-half), math.floor(half) + 1)
    panel.set_yticks(ticks, [])
    panel.set_xticks([tick for tick in ticks + 1 if abs(tick - scene.width / 2) < half], [])
    panel.tick_params(length=2.5, direction="in")
    for spine in panel.spines.values():
        spine.set_color(PLOT_GRID)


def _draw_beams(panel: Any, scene: DoorScene, palette: Palette) -> None:
    toward = scene.beams.toward()
    some = np.linspace(0, len(toward.ends) - 1, min(len(toward.ends), MOST_BEAMS)).astype(int)
    segments = np.stack([toward.begins[some], toward.ends[some]], axis=1)
    panel.add_collection(
        LineCollection(list(segments), colors=[PLOT_BEAM], linewidths=0.35, alpha=0.5, zorder=1)
    )
    for fate in Fate:
        colour, size = look_of(fate, palette)
        ends: Points = scene.beams.of(fate).ends
        marker = "x" if fate is Fate.lost else "."
        panel.plot(*ends.T, marker, color=colour, markersize=size, markeredgewidth=0.6, zorder=3)


def look_of(fate: Fate, palette: Palette) -> tuple[Any, float]:
    """Return colour and size, points, of where beams of a fate ended."""
    states = {Fate.stopped: palette.closed, Fate.through: palette.open}
    return (_part(states[fate]), 4.0) if fate in states else _LOOK[fate]


def _key(palette: Palette) -> Iterator[Any]:
    said = {
        Fate.through: "beam went through the line", Fate.stopped: "ended on it",
        Fate.short: "ended before it", Fate.lost: "did not come back (on the line)",
        Fate.aside: "not toward the door",
    }  # fmt: skip
    for fate, label in said.items():
        colour, size = look_of(fate, palette)
        marker = "x" if fate is Fate.lost else "."
        yield Line2D([], [], linestyle="", marker=marker, color=colour, markersize=size + 2,
                     label=label)  # fmt: skip
    yield Line2D([], [], color=_part(palette.robot), linewidth=2, marker="o", markersize=5,
                 label="laser, its last place as a dot")  # fmt: skip
    yield Line2D([], [], color="black", linewidth=1, marker="|", label="the door's line")
    yield Line2D([], [], color=PLOT_LEAF, linewidth=4, solid_capstyle="round",
                 label="where its leaf most likely stands")  # fmt: skip


def _part(colour: Rgb) -> tuple[float, float, float]:
    red, green, blue = colour
    return (red / 255, green / 255, blue / 255)


def _name(door: DoorPictures, letters: HasShape) -> str:
    name = drawable_name(door.label, f"door {door.figures.door_id}", letters)
    return printable(name).replace("$", r"\$")


def _figures(door: DoorPictures) -> str:
    figures = door.figures
    states = f"{figures.open} OPEN, {figures.closed} CLOSED, {figures.undecided} undecided"
    through = f", {figures.passed} driven through" if figures.passed else ""
    said = [f"{counted(figures.visits, 'visit')}: {states}{through}"]
    if math.isfinite(behind := figures.behind_m.value):
        where = "behind" if behind >= 0 else "before"
        said.append(f"beams near its line end {abs(behind):.2f} m {where} it")
    if len(door.visits) < figures.visits - figures.passed:
        said.append(f"{len(door.visits)} drawn, half of them the least sure")
    return "; ".join(said)


def _short(text: str) -> str:
    return text if len(text) <= WORD_LETTERS else f"{text[: WORD_LETTERS - 1]}…"
