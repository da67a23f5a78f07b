"""What was measured, as a picture: how fast a whole log is read, and what a moment costs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmark.peers import DUCKDB, MCAP, OURS, ROSBAGS, SQLITE

Document = dict[str, Any]
"""What `report.to_json` gives."""
COLOURS = {OURS: "#0072b2", DUCKDB: "#d55e00", SQLITE: "#009e73", MCAP: "#aa5599",
           ROSBAGS: "#aa5599", "limit": "#c9c9c9"}  # fmt: skip
"""Of Okabe and Ito's palette: told apart by the colour-blind, too, and in print."""


def draw(document: Document, path: Path) -> None:
    """Draw a picture of a run; the suffix says in which form (svg, png).

    Raises:
        ModuleNotFoundError: matplotlib is not installed.
        ValueError: The run has neither the whole log folded nor moments; or no such form.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    drawn: tuple[tuple[Any, Any], ...] = (
        (_draw_bars, _bars(document)), (_draw_lines, _lines(document)),
    )  # fmt: skip
    panels = [(work, found) for work, found in drawn if found]
    if not panels:
        raise ValueError("nothing to draw: measure fold or moment.")
    with plt.rc_context({"svg.fonttype": "path", "svg.hashsalt": "bench",
                         "axes.spines.top": False, "axes.spines.right": False,
                         "axes.grid": True, "grid.color": "#ececec", "axes.axisbelow": True,
                         "axes.titlelocation": "left", "axes.titleweight": "bold"}):  # fmt: skip
        figure, axes = plt.subplots(
            1, len(panels), figsize=(5.9 * len(panels), 4.6), squeeze=False, layout="constrained"
        )
        for (work, found), place in zip(panels, axes[0], strict=True):
            work(place, found)
        figure.savefig(path, dpi=160, metadata={"Date": None} if path.suffix == ".svg" else None)
        plt.close(figure)


def _bars(document: Document) -> dict[str, float]:
    """Return label -> events/s of each reader of the largest log, the slowest first."""
    cases = [case for case in document["cases"] if case["group"] == "fold"]
    most = max(((case["events"], _commit_size(case)) for case in cases), default=None)
    found: dict[str, float] = {}
    for case in cases:
        if (case["events"], _commit_size(case)) == most:
            for peer in _measured(case):
                name, form = peer["name"], case["key"].split(", ")[1]
                label = f"{name}, {form}" if name.startswith((OURS, "limit")) else name
                found[label] = max(found.get(label, 0.0), 1 / peer["median_s"])
    return dict(sorted(found.items(), key=lambda bar: bar[1]))


def _lines(document: Document) -> dict[str, list[tuple[int, float]]]:
    """Return (events, milliseconds) of each peer's moment, warm; only if there are two sizes."""
    found: dict[str, list[tuple[int, float]]] = {}
    for case in document["cases"]:
        if case["key"] == "moment, zstd":
            for peer in _measured(case):
                found.setdefault(peer["name"], []).append((case["events"], peer["median_s"] * 1e3))
    return {name: sorted(points) for name, points in found.items()
            if len(points) > 1 and not name.endswith("2 cores")}  # fmt: skip


def _draw_bars(axes: Any, bars: dict[str, float]) -> None:
    drawn = axes.barh(list(bars), list(bars.values()), color=[_colour(name) for name in bars])
    axes.bar_label(drawn, [f"{rate:,.3g}" for rate in bars.values()], padding=3)
    axes.set_xscale("log")
    axes.margins(x=0.2)
    axes.set(xlabel="events per second", title="The whole log read and folded")


def _draw_lines(axes: Any, lines: dict[str, list[tuple[int, float]]]) -> None:
    for name, points in lines.items():
        axes.loglog(*zip(*points, strict=True), color=_colour(name), marker="o", label=name,
                    linewidth=3 if name.startswith(OURS) else 1.8)  # fmt: skip
    axes.legend(fontsize="small")
    axes.set(xlabel="events in the log", ylabel="ms", title="The door map at a random moment")


def _colour(name: str) -> str:
    return next((c for start, c in COLOURS.items() if name.startswith(start)), "#8a8a8a")


def _measured(case: Document) -> list[Document]:
    return [peer for peer in case["peers"] if "problem" not in peer]


def _commit_size(case: Document) -> int:
    return int(case["key"].rpartition(", ")[2])
