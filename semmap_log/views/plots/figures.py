"""The one place that imports matplotlib; if it is missing, the error says how to install it.

It also draws the rooms of floor plans (tinted, named, with the doors between them), a floor plan's
cells (of a large plan, blocks of cells), and reliability diagrams: how often outcomes came true at
each forecast probability, and how often it was forecast.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.evaluation import Evaluation
from semmap_log.analysis.probabilities.scores import BINS, Reliability, Scores
from semmap_log.analysis.rooms import Room, RoomPlan
from semmap_log.analysis.rooms.level_rooms import OCCUPIED_FROM, LevelRooms
from semmap_log.core.io.disk import output_errors, whole_file
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import FloorMap
from semmap_log.core.texts import counted
from semmap_log.errors import FormatError, MissingExtraError
from semmap_log.views.event_words import HasShape, drawable_name, printable
from semmap_log.views.palette import (
    PLOT_BARS,
    PLOT_CURVE,
    PLOT_LIFT,
    PLOT_MARKS,
    PLOT_PROPOSED,
    PLOT_ROOM_NAME,
    PLOT_WALLS,
    rooms_image,
)
from semmap_log.views.timeline_table import known_in_words

try:
    import matplotlib as mpl
    from matplotlib import font_manager, patches, text
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
except ImportError:
    raise MissingExtraError("matplotlib", "plots") from None

__all__ = [
    "Figure",
    "Line2D",
    "LineCollection",
    "has_shape",
    "letters_of",
    "mpl",
    "new_figure",
    "patches",
    "save_figure",
]

FORMATS = (".png", ".svg")
DPI = 120
MOST_PIXELS = 2**16 - 1
"""A side of a picture, as far as matplotlib goes: thousands of lanes are drawn smaller."""
SVG_STYLE = {"svg.hashsalt": "semmap-log", "svg.fonttype": "none"}
"""Settings that make equal plots equal files, with searchable text."""
MORE_FONTS = (
    "Noto Sans CJK SC", "Noto Sans CJK JP", "Source Han Sans SC", "WenQuanYi Zen Hei",
    "WenQuanYi Micro Hei", "PingFang SC", "Hiragino Sans", "Microsoft YaHei", "Malgun Gothic",
    "Noto Sans Arabic", "Noto Sans Hebrew", "Noto Sans Thai", "Noto Sans Devanagari",
)  # fmt: skip
"""Where there are any, they have the letters of names that matplotlib's own font lacks."""


class ShownFigure(Figure):
    """A figure that a notebook shows wherever it was made, also without `%matplotlib`."""

    def _repr_png_(self) -> bytes:
        data = BytesIO()
        _add_letters(self)
        self.savefig(data, format="png", dpi=DPI)
        return data.getvalue()


def new_figure(width: float, height: float, **how: Any) -> Any:
    """Return a figure, inches, that needs no screen."""
    figure = ShownFigure(figsize=(width, height), dpi=DPI, **how)
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure, whole or not at all, in the format that the name's suffix names.

    Raises:
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    if path.suffix not in FORMATS:
        raise FormatError(path, f"expected a name that ends in {' or '.join(FORMATS)}")
    metadata = {"Date": None} if path.suffix == ".svg" else {}
    dpi = min(DPI, int(MOST_PIXELS / max(figure.get_size_inches())))
    if path.suffix == ".png":
        _add_letters(figure)
    with (
        output_errors(path),
        whole_file(path) as temporary,
        mpl.rc_context(SVG_STYLE),
        warnings.catch_warnings(),
    ):
        # Names have no such letter; of a zone or a robot it may be a box in the picture.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure.savefig(temporary, format=path.suffix[1:], dpi=dpi, metadata=metadata)


def _add_letters(figure: Any) -> None:
    """Use available fonts for text whose letters the usual font lacks."""
    families = _families()
    for words in figure.findobj(text.Text) if len(families) > 1 else []:
        words.set_fontfamily(families)


def letters_of(path: Path) -> HasShape:
    """Return a function that checks whether a picture of that name can draw a character.

    In an .svg a letter stays a letter: the program that shows it chooses a font that has it.
    """
    return _has_any_shape if path.suffix == ".svg" else has_shape


@cache
def has_shape(character: str) -> bool:
    """Return whether an available font has a shape for a character."""
    return any(font.get_char_index(ord(character)) for font in _fonts())


def _has_any_shape(_: str) -> bool:
    return True


@cache
def _families() -> list[str]:
    here = set(font_manager.get_font_names())
    return [*mpl.rcParams["font.family"], *(name for name in MORE_FONTS if name in here)]


@cache
def _fonts() -> list[Any]:
    wanted = (font_manager.FontProperties(family=[family]) for family in _families())
    return [font_manager.get_font(font_manager.findfont(each)) for each in wanted]


WIDE_IN, LEAST_IN, MOST_IN = 14.0, 3.0, 14.0
NAME_PT, LEAST_PT = 7.0, 4.0
LETTER_EM = 0.6
"""About how wide a letter is."""
POINTS_AN_INCH = 72
KINDS = (
    (PLOT_CURVE, "joins two rooms"),
    (PLOT_PROPOSED, "the same room on both sides, or none"),
    (PLOT_LIFT, "of a lift"),
)


def draw_rooms(
    plan: RoomPlan, *, level: int | None = None, title: str, letters: HasShape = has_shape
) -> Any:
    """Return the figure: a panel for each level with a floor plan, the lowest number on top.

    Args:
        plan: Of a moment.
        level: Only that level; None: all.
        title: Above all.
        letters: Returns whether a letter has a shape; a room whose name has one without a shape is
            labelled with its number.
    """
    levels = [each for each in plan.levels if level in (None, each)]
    spans = [_span(plan.levels[each]) for each in levels]
    heights = [
        min(max(WIDE_IN * tall / max(wide, tall * 1e-3, 1e-9), LEAST_IN), MOST_IN)
        for wide, tall in spans
    ]
    figure = new_figure(WIDE_IN + 1.0, sum(heights) + 0.9, layout="constrained")
    panels = figure.subplots(len(levels), 1, squeeze=False, height_ratios=heights)[:, 0]
    for number, each, panel in zip(range(len(levels)), levels, panels, strict=True):
        _draw_level(panel, plan, each, letters)
        panel.set_title(plan.door_map.level_name(each), loc="left", fontsize="medium")
        if not number:
            _draw_legend(panel)
    figure.suptitle(title)
    return figure


def _draw_level(panel: Any, plan: RoomPlan, level: int, letters: HasShape) -> None:
    rooms, floor = plan.levels[level], plan.floors[level]
    extent = _extent(rooms)
    panel.imshow(rooms_image(rooms), origin="lower", extent=extent, interpolation="nearest")
    _draw_walls(panel, floor)
    for doorway in plan.graph.doorways.values():
        if doorway.level == level:
            _draw_door(panel, plan, plan.door_map[doorway.door_id])
    left, right, low, high = extent
    panel.set(xlim=(left, right), ylim=(low, high), xlabel="x, metres", ylabel="y, metres")
    panel.set_aspect("equal")
    points_a_metre = WIDE_IN * POINTS_AN_INCH / max(right - left, 1e-6)
    for room in plan.graph.rooms.values():
        if room.level == level:
            _draw_name(panel, room, letters, points_a_metre)


def _draw_walls(panel: Any, floor: FloorMap) -> None:
    cells, extent = plan_cells(floor)
    walls = cells >= OCCUPIED_FROM
    if walls.any():
        panel.contourf(walls, levels=[0.5, 1.5], colors=[PLOT_WALLS], origin="lower", extent=extent)


def _draw_door(panel: Any, plan: RoomPlan, door: Door) -> None:
    doorway = plan.graph.doorways[door.door_id]
    colour = PLOT_CURVE if doorway.joins_two else PLOT_PROPOSED
    if plan.graph.lift_of(door.door_id) is not None:
        colour = PLOT_LIFT
    panel.plot(*zip(door.start, door.end, strict=True), color=colour, linewidth=3,
               solid_capstyle="butt", scalex=False, scaley=False)  # fmt: skip


def _draw_name(panel: Any, room: Room, letters: HasShape, points_a_metre: float) -> None:
    """Write a room's name about as large as fits; else its number."""
    name = printable(drawable_name(room.name or "", "", letters))
    side_pt = room.area_m2**0.5 * points_a_metre
    size = min(NAME_PT, side_pt / (LETTER_EM * max(len(name), 1)))
    said, size = (name, size) if name and size >= LEAST_PT else (str(room.room_id), NAME_PT)
    panel.text(room.x, room.y, said.replace("$", r"\$"), fontsize=size, ha="center", va="center",
               color=PLOT_ROOM_NAME, clip_on=True)  # fmt: skip


def _draw_legend(panel: Any) -> None:
    for colour, words in KINDS:
        panel.plot([], [], color=colour, linewidth=3, label=words)
    panel.legend(loc="lower right", fontsize="small", ncols=len(KINDS), borderaxespad=0,
                 bbox_to_anchor=(1.0, 1.01), frameon=False)  # fmt: skip


def _extent(rooms: LevelRooms) -> tuple[float, float, float, float]:
    grid = rooms.geometry
    wide, tall = grid.width * grid.resolution, grid.height * grid.resolution
    return grid.origin_x, grid.origin_x + wide, grid.origin_y, grid.origin_y + tall


def _span(rooms: LevelRooms) -> tuple[float, float]:
    left, right, low, high = _extent(rooms)
    return right - left, high - low


PANEL_IN, ROW_IN = 2.6, 3.5
HEAD_IN, FOOT_IN = 0.5, 0.3
COLUMNS = 4
HEIGHTS = (3.0, 1.0)
"""Of a diagram, and of the bars below it."""
LEAST_AREA, MOST_AREA = 6.0, 120.0
"""Points squared: the dots of an almost empty bin, and of the fullest."""


def plot_calibration(evaluation: Evaluation, path: Path, *, name: str) -> None:
    """Draw a panel for each estimator into a .png or .svg.

    On the diagonal, outcomes came as often as forecast. The bars below, and the area of the dots,
    show how many forecasts lie in each bin.

    Args:
        evaluation: The evaluation; diagrams are of all doors together, figures their mean.
        path: The file; what is there is replaced once the new one is whole.
        name: The log's name.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    save_figure(draw_calibration(evaluation, name=name), path)


def draw_calibration(evaluation: Evaluation, *, name: str) -> Any:
    """Return the figure."""
    found, mean = evaluation.reliability, evaluation.mean
    columns = min(COLUMNS, len(found))
    rows = math.ceil(len(found) / columns)
    figure = new_figure(max(2, columns) * PANEL_IN, rows * ROW_IN + HEAD_IN + FOOT_IN,
                        layout="constrained")  # fmt: skip
    pairs = list(_panels(figure, rows, columns))
    most = max(float(reliability.count.max()) for reliability in found.values())
    for (diagram, bars), (estimator, reliability) in zip(pairs, found.items(), strict=False):
        _draw(diagram, reliability)
        _draw_counts(bars, reliability, most)
        diagram.set_title(printable(estimator), fontsize=9, fontweight="bold", pad=16)
        diagram.annotate(_figures(mean[estimator]), (0.5, 1), (0, 5), fontsize=8, ha="center",
                         xycoords="axes fraction", textcoords="offset points")  # fmt: skip
    for pair in pairs[len(found) :]:
        for panel in pair:
            panel.set_visible(False)
    outcome = "share found open" if evaluation.is_truth else "share next read as open"
    for diagram, bars in pairs[::columns]:
        diagram.set_ylabel(outcome, fontsize=9)
        bars.set_ylabel("forecasts", fontsize=9)
    for _, bars in pairs[max(len(found) - columns, 0) : len(found)]:
        bars.set_xlabel("forecast P(open)", fontsize=9)
        bars.tick_params(labelbottom=True)
    handles, labels = pairs[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    figure.suptitle(_title(evaluation, name), fontsize=10)
    return figure


def _panels(figure: Any, rows: int, columns: int) -> Iterator[tuple[Any, Any]]:
    """Yield a diagram and the bars below it, from left to right, row by row."""
    panels = figure.subplots(2 * rows, columns, sharex=True, sharey="row", squeeze=False,
                             height_ratios=HEIGHTS * rows)  # fmt: skip
    for row in range(rows):
        yield from zip(panels[2 * row], panels[2 * row + 1], strict=True)


def _draw(panel: Any, found: Reliability) -> None:
    rows = found.rows()
    said, came = [row[0] for row in rows], [row[1] for row in rows]
    most = max((row[2] for row in rows), default=1)
    area = [LEAST_AREA + MOST_AREA * row[2] / most for row in rows]
    panel.plot([0, 1], [0, 1], color=PLOT_MARKS, linewidth=1, linestyle="--",
               label="perfect: as forecast, so it came")  # fmt: skip
    panel.plot(said, came, color=PLOT_CURVE, linewidth=1)
    panel.scatter(said, came, s=area, color=PLOT_CURVE, linewidth=0, zorder=3, clip_on=False,
                  label="forecasts of a bin; area: how many")  # fmt: skip
    ticks = np.linspace(0, 1, 6)
    panel.set(xlim=(0, 1), ylim=(0, 1), xticks=ticks, yticks=ticks)
    panel.set_axisbelow(True)
    panel.grid(color=PLOT_BARS, alpha=0.4, linewidth=0.6)
    panel.tick_params(labelsize=7)


def _draw_counts(panel: Any, found: Reliability, most: float) -> None:
    """Draw how many forecasts lie in each bin, on a scale that shows small counts next to large."""
    edges = np.arange(BINS) / BINS
    panel.bar(edges, found.count, 1 / BINS, align="edge", color=PLOT_BARS, edgecolor="white",
              linewidth=0.5)  # fmt: skip
    for edge, count in zip(edges, found.count.tolist(), strict=True):
        if count:
            panel.annotate(_short(int(count)), (edge + 0.5 / BINS, count), (0, 1), fontsize=6,
                           textcoords="offset points", ha="center", color=PLOT_MARKS)  # fmt: skip
    panel.set_yscale("log")
    panel.set(ylim=(0.8, 8 * max(most, 1.0)))
    panel.tick_params(labelsize=7)
    panel.minorticks_off()


def _title(evaluation: Evaluation, name: str) -> str:
    doors = len(evaluation.doors)
    of = "" if doors == 1 else f", {counted(doors, 'door')}"
    called = printable(name).replace("$", r"\$")
    return f"Forecast, and what came: {called}{of}\n{known_in_words(evaluation)}"


def _figures(scores: Scores) -> str:
    return f"Brier {scores.brier:.4f}, ECE {scores.ece:.3f}, bias {scores.bias:+.3f}"


def _short(count: int) -> str:
    """Return a number of forecasts in a few characters: 912, 1.2k, 12k, 1.2M."""
    if count < 1000:
        return str(count)
    scaled, unit = (count / 1e3, "k") if count < 1e6 else (count / 1e6, "M")
    return f"{scaled:.1f}{unit}" if scaled < 9.95 else f"{scaled:.0f}{unit}"


MOST_CELLS = 4_000_000
"""A picture has fewer; more would only take memory."""


def plan_cells(
    floor: FloorMap, *, most_cells: int = MOST_CELLS
) -> tuple[NDArray[np.int8], tuple[float, float, float, float]]:
    """Return cells, the lowest y first, and what they cover: x0, x1, y0, y1, metres.

    Of a larger plan each cell stands for a block, and shows its most occupied one, so that no wall
    is lost.

    Args:
        floor: The plan.
        most_cells: How many a picture may have, about.
    """
    height, width = floor.cells.shape
    stride = max(1, math.ceil(math.sqrt(height * width / most_cells)))
    cells = floor.cells
    if stride > 1:
        rows, columns = np.arange(0, height, stride), np.arange(0, width, stride)
        cells = np.maximum.reduceat(np.maximum.reduceat(cells, rows, axis=0), columns, axis=1)
    side_m = floor.resolution * stride
    return cells, (
        floor.origin_x, floor.origin_x + cells.shape[1] * side_m,
        floor.origin_y, floor.origin_y + cells.shape[0] * side_m,
    )  # fmt: skip
