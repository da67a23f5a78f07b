"""State lanes as a picture: when each door was open, closed, unknown; the patrol rounds above.

The height of a bar says the same as its colour, for whoever prints it or does not see colours.
"""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.history import ROUND_KINDS, Round, rounds
from semmap_log.core.folds.timeline import Timeline, Times
from semmap_log.core.model.doors import DoorId, DoorState, reduced
from semmap_log.core.model.moments import DAY_NS, format_short
from semmap_log.views.event_words import HasShape, drawable_name, printable
from semmap_log.views.palette import DEFAULT, PLOT_GRID, Palette, Rgb
from semmap_log.views.plots import figures
from semmap_log.views.time_axis import WallClock, time_ticks
from semmap_log.views.zone_times import MS_NS, Span, zone_offsets

if TYPE_CHECKING:
    from semmap_log.core.io.progress import Progress
    from semmap_log.core.model.moments import Time
    from semmap_log.log import DoorLog

WIDE_IN = 10.0
TALL_LANE_IN, LOW_LANE_IN = 0.28, 0.15
MANY_LANES = 40
"""With so many lanes, lanes are low, names small, and times also stand above them."""
HEAD_IN, FOOT_IN = 0.5, 0.75
MOST_INTERVALS = 3_000
"""Of a lane of some thousand pixels. With more, each column shows its longest state."""
HEIGHTS = {DoorState.OPEN: 0.8, DoorState.CLOSED: 0.4, DoorState.UNKNOWN: 0.12}
"""Share of its lane that a bar fills."""
LAPSED = len(DoorState)
"""Added to a state if the door was not seen since; drawn as a line in the state's colour."""
ROUND_HEIGHT = 0.5
LANE_FLOOR = 0.4
"""Below the middle of its lane, where a bar stands."""
NAME_LETTERS = 34
LETTER_IN = 0.074
"""Mean width of a letter in small print."""


@dataclass(frozen=True, slots=True)
class Lanes:
    """What there is to draw."""

    doors: Mapping[DoorId, Timeline]
    """A lane each, from the top in this order."""
    names: Mapping[DoorId, str]
    """Names of doors; others are shown by their ids."""
    rounds: Sequence[Round]
    start_ns: int
    end_ns: int
    tz: str
    """IANA zone of the axis."""

    @classmethod
    def of(
        cls,
        log: DoorLog,
        doors: Collection[DoorId | str] | None = None,
        since: Time = None,
        until: Time = None,
        *,
        progress: Progress | None = None,
    ) -> Lanes:
        """Return the lanes of a log, as they are known today.

        Args:
            log: The log.
            doors: Only these; None: all that were in the map.
            since: From then on; default: the first event.
            until: Before then; default: the last.
            progress: Called with the progress of reading.

        Raises:
            MomentError: `since` comes after `until`.
        """
        found = log.timelines(doors, since=since, until=until, progress=progress)
        there = {door_id: each for door_id, each in found.items() if len(each)}
        driven = rounds(log.history(kinds=ROUND_KINDS))
        times = [ns for each in there.values() for ns in (each.start_ns[0], each.end_ns[-1])]
        times += [ns for each in driven for ns in (each.start_ns, each.end_ns) if ns is not None]
        since_ns, until_ns = log.instant(since), log.instant(until)
        start_ns = min(times, default=0) if since_ns is None else since_ns
        end_ns = max(times, default=0) if until_ns is None else until_ns
        return cls(
            there,
            log.door_labels(),
            [each for each in driven if each.overlaps(start_ns, end_ns)],
            int(start_ns),
            int(end_ns),
            log.info.timezone,
        )

    @classmethod
    def of_timeline(cls, timeline: Timeline, *, name: str, tz: str) -> Lanes:
        """Return a door's lane alone; "": it has no name."""
        start_ns = int(timeline.start_ns[0]) if len(timeline) else 0
        end_ns = int(timeline.end_ns[-1]) if len(timeline) else 0
        names = {timeline.door_id: name} if name else {}
        return cls({timeline.door_id: timeline}, names, [], start_ns, end_ns, tz)


def plot_lanes(lanes: Lanes, path: Path, palette: Palette = DEFAULT) -> None:
    """Draw a lane for each door, and one for each robot's rounds, into a .png or .svg.

    Args:
        lanes: With at least one door or round.
        path: The file; what is there is replaced once the new one is whole.
        palette: Colours.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    figures.save_figure(draw_lanes(lanes, palette, figures.letters_of(path)), path)


def draw_lanes(
    lanes: Lanes, palette: Palette = DEFAULT, letters: HasShape = figures.has_shape
) -> Any:
    """Return the figure; a door whose name has a letter without a shape is shown by its id."""
    robots = sorted({each.actor for each in lanes.rounds})
    count = len(robots) + len(lanes.doors)
    lane_in = LOW_LANE_IN if count >= MANY_LANES else TALL_LANE_IN
    figure = figures.new_figure(WIDE_IN, count * lane_in + HEAD_IN + FOOT_IN, layout="constrained")
    panel = figure.subplots()
    panel.set_autoscale_on(False)  # it looks at all lanes again for each: minutes
    for place, robot in enumerate(robots):
        own = [each for each in lanes.rounds if each.actor == robot]
        _draw_rounds(panel, place, own, lanes, palette)
    for place, timeline in enumerate(lanes.doors.values(), len(robots)):
        _draw_door(panel, place, timeline, lanes, palette)
    labels = [
        f"rounds of {drawable_name(robot, f'robot {place}', letters)}" if robot else "rounds"
        for place, robot in enumerate(robots, 1)
    ]
    labels += [drawable_name(lanes.names.get(n, ""), str(n), letters) for n in lanes.doors]
    small = "xx-small" if count >= MANY_LANES else "small"
    panel.set_yticks(np.arange(count), [_short(label) for label in labels], fontsize=small)
    panel.set_ylim(count - 0.5, -0.5)
    panel.tick_params(axis="y", length=0)
    _time_along(panel, lanes)
    _explain(figure, panel, lanes, palette, has_rounds=bool(robots))
    return figure


def _draw_door(panel: Any, place: int, timeline: Timeline, lanes: Lanes, palette: Palette) -> None:
    start_ns, end_ns, state = _as_seen(timeline, lanes)
    shown = np.array([int(reduced(DoorState(value))) for value in DoorState])[state % LAPSED]
    for value, height in HEIGHTS.items():
        for is_lapsed in (False, True):
            chosen = (shown == int(value)) & ((state >= LAPSED) == is_lapsed)
            spans = _spans(start_ns[chosen], end_ns[chosen])
            high = HEIGHTS[DoorState.UNKNOWN] if is_lapsed else height
            _bars(panel, place, spans, high, palette.of_state(value))


def _draw_rounds(
    panel: Any, place: int, rounds: Sequence[Round], lanes: Lanes, palette: Palette
) -> None:
    starts = [lanes.start_ns if each.start_ns is None else each.start_ns for each in rounds]
    ends = [lanes.end_ns if each.end_ns is None else each.end_ns for each in rounds]
    edges = np.clip(np.array([starts, ends]), lanes.start_ns, lanes.end_ns)
    _bars(panel, place, _spans(*edges), ROUND_HEIGHT, palette.robot)


def _bars(
    panel: Any, place: int, spans: list[tuple[float, float]], height: float, colour: Rgb
) -> None:
    """Draw bars that stand on the floor of their lane."""
    floor = place + LANE_FLOOR
    panel.broken_barh(spans, (floor - height, height), color=np.array(colour) / 255, linewidth=0)


def _spans(start_ns: Times, end_ns: Times) -> list[tuple[float, float]]:
    """Return starts and lengths, in days as matplotlib counts them."""
    return list(zip(_days(start_ns).tolist(), _days(end_ns - start_ns).tolist(), strict=True))


def _as_seen(timeline: Timeline, lanes: Lanes) -> tuple[Times, Times, NDArray[np.uint8]]:
    """Return start, end and state of what a lane can resolve; lapses have `LAPSED` added."""
    if len(timeline) + len(timeline.lapse_start_ns) <= MOST_INTERVALS:
        return _cut_at_lapses(timeline)
    edges = np.linspace(lanes.start_ns, lanes.end_ns, MOST_INTERVALS + 1).astype(np.int64)
    spent = np.stack(
        [timeline.spent_ns(state, edges) for state in DoorState]
        + [timeline.lapsed_ns(state, edges) for state in DoorState]
    )
    there = spent.any(axis=0)
    return edges[:-1][there], edges[1:][there], spent.argmax(axis=0).astype(np.uint8)[there]


def _cut_at_lapses(timeline: Timeline) -> tuple[Times, Times, NDArray[np.uint8]]:
    """Return the intervals cut where lapses begin and end, in order."""
    lapse_start_ns, lapse_end_ns = timeline.lapse_start_ns, timeline.lapse_end_ns
    cuts = np.unique(np.concatenate([timeline.start_ns, lapse_start_ns, lapse_end_ns]))
    end_ns = np.append(cuts[1:], timeline.end_ns[-1:])
    cuts = cuts[: len(end_ns)]
    state = timeline.state[np.searchsorted(timeline.start_ns, cuts, "right") - 1]
    is_lapsed = np.isin(cuts, lapse_start_ns)
    return cuts, end_ns, (state + LAPSED * is_lapsed).astype(np.uint8)


def _time_along(panel: Any, lanes: Lanes) -> None:
    """Label the axis by the building's clocks; a log of one moment is a minute wide."""
    wide_ns = max(lanes.end_ns - lanes.start_ns, 60 * 10**9)
    start_ms, wide_ms = lanes.start_ns // MS_NS, wide_ns // MS_NS
    clock = WallClock(zone_offsets(Span(start_ms, start_ms + wide_ms), lanes.tz))
    names = max((len(tick.get_text()) for tick in panel.get_yticklabels()), default=0)
    letters = WIDE_IN / LETTER_IN - names
    ticks = time_ticks(start_ms, start_ms + wide_ms, clock, letters=letters, anchor=0.5)
    at_ns = np.array([tick.at_ms for tick in ticks], np.int64) * MS_NS
    panel.set_xlim(*_days(np.array([lanes.start_ns, lanes.start_ns + wide_ns])))
    panel.set_xticks(_days(at_ns), [tick.label for tick in ticks])
    panel.tick_params(axis="x", labelsize="small", labeltop=len(panel.get_yticks()) >= MANY_LANES)
    panel.grid(axis="x", linewidth=0.4, color=PLOT_GRID)
    panel.set_axisbelow(True)
    for side in ("top", "right", "left"):
        panel.spines[side].set_visible(False)


def _explain(figure: Any, panel: Any, lanes: Lanes, palette: Palette, *, has_rounds: bool) -> None:
    ends = lanes.start_ns, lanes.end_ns
    start, end = (format_short(ns, lanes.tz, seconds=False) for ns in ends)
    panel.set_title(f"{start} to {end} ({lanes.tz})", fontsize="medium", loc="left")
    colours = {
        "open": palette.open, "closed (half as high)": palette.closed,
        "unknown (a line)": palette.unknown,
    } | ({"patrol round": palette.robot} if has_rounds else {})  # fmt: skip
    handles = [
        figures.patches.Patch(color=np.array(colour) / 255, label=label)
        for label, colour in colours.items()
    ]
    if any(len(timeline.lapse_start_ns) for timeline in lanes.doors.values()):
        label = "not seen since (a line in its colour)"
        edge = np.array(palette.open) / 255
        handles.insert(3, figures.patches.Patch(fill=False, edgecolor=edge, label=label))
    figure.legend(
        handles=handles, loc="outside lower left", ncols=len(handles), fontsize="small",
        frameon=False,
    )  # fmt: skip


def _days(ns: Times) -> NDArray[np.float64]:
    """Return times as matplotlib counts them: days since 1970, UTC."""
    return np.asarray(ns / DAY_NS, np.float64)


def _short(name: str) -> str:
    return textwrap.shorten(printable(name).replace("$", r"\$"), NAME_LETTERS, placeholder="…")
