"""What was measured, as a picture: how fast a whole log is read, and what a moment costs."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmark.peers import DUCKDB, MCAP, OURS, ROSBAGS, SQLITE

Document = dict[str, Any]
"""What `report.to_json` gives."""

INK, GREY, LIGHT = "#222222", "#8a8a8a", "#c9c9c9"
BLUE, ORANGE, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#aa5599"
"""Of Okabe and Ito's palette: told apart by the colour-blind, too, and in print."""
COLOURS = {OURS: BLUE, DUCKDB: ORANGE, SQLITE: GREEN, MCAP: PURPLE, ROSBAGS: PURPLE, "limit": LIGHT}
SHORT = {MCAP: "mcap + decode, Python fold", ROSBAGS: "rosbags, Python fold"}


def draw(document: Document, path: Path) -> None:
    """Draw a picture of a run; the suffix says in which form (svg, png).

    Raises:
        ModuleNotFoundError: matplotlib is not installed.
        ValueError: The run has neither the whole log folded nor moments; or no such form.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    bars, lines = _bars(document), _lines(document)
    panels = [panel for panel in (bars, lines) if panel]
    if not panels:
        raise ValueError("nothing to draw: measure fold or moment.")
    with plt.rc_context({"font.size": 10, "font.family": "DejaVu Sans", "svg.fonttype": "path",
                         "svg.hashsalt": "bench", "axes.edgecolor": GREY, "text.color": INK,
                         "xtick.color": INK, "ytick.color": INK}):  # fmt: skip
        figure, axes = plt.subplots(
            1, len(panels), figsize=(5.9 * len(panels), 4.6), squeeze=False, layout="constrained"
        )
        figure.get_layout_engine().set(w_pad=0.15)  # type: ignore[union-attr,call-arg]
        if bars:
            _draw_bars(axes[0][0], bars, _largest(document, "fold"))
        if lines:
            _draw_lines(axes[0][-1], lines)
        figure.savefig(path, dpi=160, metadata={"Date": None} if path.suffix == ".svg" else None)
        plt.close(figure)


def _bars(document: Document) -> list[tuple[str, float, str]]:
    """Return label, events/s and colour of each reader of the largest log, the fastest first."""
    most = _largest(document, "fold")
    cases = [case for case in document["cases"]
             if case["group"] == "fold" and case["events"] == most]  # fmt: skip
    last = max((_commit_size(case) for case in cases), default=0)
    found: dict[str, tuple[float, str]] = {}
    for case in cases:
        if _commit_size(case) != last:
            continue
        for peer in _measured(case):
            label, colour = _label(peer["name"], case["key"].split(", ")[1])
            rate = 1 / peer["median_s"]
            if label not in found or rate > found[label][0]:
                found[label] = (rate, colour)
    return sorted(
        ((label, rate, colour) for label, (rate, colour) in found.items()), key=lambda bar: bar[1]
    )


def _label(name: str, form: str) -> tuple[str, str]:
    colour = next(colour for start, colour in COLOURS.items() if name.startswith(start))
    if name.startswith("limit"):
        return f"limit: {'zstd + ' * (form == 'zstd')}CRC + numpy, {form}", colour
    if name.startswith(OURS):
        return f"{name.replace(', ', f', {form}, ')}", colour
    return SHORT.get(name, name), colour


def _draw_bars(axes: Any, bars: list[tuple[str, float, str]], events: int) -> None:
    places = range(len(bars))
    axes.barh(places, [rate for _, rate, _ in bars], color=[colour for *_, colour in bars],
              height=0.72)  # fmt: skip
    axes.set_xscale("log")
    low, high = min(rate for _, rate, _ in bars), max(rate for _, rate, _ in bars)
    axes.set_xlim(low / 3, high * 5)
    for place, (_, rate, _) in zip(places, bars, strict=True):
        axes.text(rate * 1.12, place, _rate(rate), va="center", fontsize=9)
    axes.set_yticks(places, [label for label, *_ in bars])
    for tick, (label, *_) in zip(axes.get_yticklabels(), bars, strict=True):
        tick.set_fontweight("bold" if label.startswith(OURS) else "normal")
    axes.tick_params(axis="y", length=0)
    decades = [10**n for n in range(3, 10) if low / 3 < 10**n < high * 5]
    axes.set_xticks(decades, [_count(decade) for decade in decades])
    axes.minorticks_off()
    axes.set_xlabel("events per second")
    axes.set_title(f"The whole log read and folded, {_count(events)} events", loc="left",
                   fontsize=11, fontweight="bold")  # fmt: skip
    _clear(axes, "x")


def _lines(document: Document) -> dict[str, list[tuple[int, float]]]:
    """Return (events, milliseconds) of each peer's moment, warm; only if there are two sizes."""
    found: dict[str, list[tuple[int, float]]] = {}
    for case in document["cases"]:
        if case["key"] == "moment, zstd":
            for peer in _measured(case):
                found.setdefault(peer["name"], []).append((case["events"], peer["median_s"] * 1e3))
    return {name: sorted(points) for name, points in found.items()
            if len(points) > 1 and not name.endswith("2 cores")}  # fmt: skip


def _draw_lines(axes: Any, lines: dict[str, list[tuple[int, float]]]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    ends = []
    for name, points in lines.items():
        label, colour = _label(name, "")
        is_ours = name.startswith(OURS)
        axes.plot(*zip(*points, strict=True), color=colour, marker="o", markersize=5 + is_ours,
                  linewidth=3 if is_ours else 1.8)  # fmt: skip
        ends.append([points[-1][1], label.removesuffix(", 1 core"), colour, is_ours, points[-1]])
    most = max(points[-1][0] for points in lines.values())
    least = min(points[0][0] for points in lines.values())
    axes.set_xlim(least / 1.6, most * 1.6)
    for place, label, colour, is_ours, (_, ms) in _apart(ends):
        axes.annotate(f"{label}\n{_ms(ms)}", (most * 1.75, place), color=colour, va="center",
                      fontsize=9, fontweight="bold" if is_ours else "normal",
                      annotation_clip=False)  # fmt: skip
    sizes = sorted({events for points in lines.values() for events, _ in points})
    axes.set_xticks(sizes, [_count(events) for events in sizes])
    axes.minorticks_off()
    low, high = axes.get_ylim()
    decades = [10.0**n for n in range(-2, 6) if low <= 10.0**n <= high]
    axes.set_yticks(decades, [_ms(ms) for ms in decades])
    axes.minorticks_off()
    axes.set_xlabel("events in the log")
    axes.set_title(
        "The door map at a random moment, median", loc="left", fontsize=11, fontweight="bold"
    )
    _clear(axes, "both")


def _apart(ends: list[list[Any]], least: float = 3.4) -> list[list[Any]]:
    """Return the labels, lowest first, each at least so many times above the one before."""
    ends = sorted(ends, key=lambda end: end[0])
    for below, end in pairwise(ends):
        end[0] = max(end[0], below[0] * least)
    return ends


def _clear(axes: Any, grid: str) -> None:
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(visible=True, which="major", axis=grid, color="#ececec", linewidth=0.8)
    axes.set_axisbelow(True)


def _measured(case: Document) -> list[Document]:
    return [peer for peer in case["peers"] if "problem" not in peer]


def _largest(document: Document, group: str) -> int:
    return max((case["events"] for case in document["cases"] if case["group"] == group), default=0)


def _commit_size(case: Document) -> int:
    return int(case["key"].rpartition(", ")[2])


def _rate(rate: float) -> str:
    return f"{rate / 1e6:.1f} M" if rate >= 1e6 else f"{rate / 1e3:.0f} k"


def _ms(ms: float) -> str:
    return f"{ms / 1e3:.3g} s" if ms >= 1000 else f"{ms:.2g} ms" if ms < 100 else f"{ms:.0f} ms"


def _count(events: int) -> str:
    for unit, word in ((10**6, "M"), (10**3, "k")):
        if events >= unit and events % unit == 0:
            return f"{events // unit} {word}"
    return f"{events:,}"
