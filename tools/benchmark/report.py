"""What was measured, as one table or one JSON document."""

from __future__ import annotations

import os
import platform
import sqlite3
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console, RenderableType
from rich.table import Table

from benchmark.case import Case, Measured

Result = tuple[Case, list[Measured]]

PACKAGES = ("semmap-log", "numpy", "mcap", "mcap-ros2-support", "zstandard")
MIB = 2**20

NOTES = """\
Medians of n turns, taken by the peers in rounds (A B A B); a first round warms up and does not \
count. Each peer has a process of its own: peak MiB is the most that it had while it worked, with \
interpreter, libraries and mapped pages of files.
times: how often our time goes into the peer's; above 1x we are ahead. promised: DESIGN section 9.
Every answer is compared with one found in another way (a plain fold of the same events, the rows \
or bytes given); where it differs, the figure is WRONG.
append: commits are given as event objects, as bytes, as rows. replay, moment, open: the mcap \
library reads the log's first segments only, at least 20,000 events, scaled per event, and only \
topics that matter to the doors; the files are in the page cache.
""".splitlines()


def show(results: Sequence[Result], machine: dict[str, Any]) -> None:
    """Print the table on stdout, for people: 80 columns."""
    console = Console(width=80, highlight=False)
    console.print(_machine_line(machine))
    console.print(f"{machine['date']}   {machine['command']}", style="dim")
    console.print(_table(results))
    for note in NOTES:
        console.print(f"- {note}", style="dim")


def to_json(results: Sequence[Result], machine: dict[str, Any]) -> dict[str, Any]:
    """Return the same as one document; times in seconds per unit, memory in bytes."""
    return {
        **machine,
        "cases": [
            {
                "group": case.group,
                "title": case.title,
                "events": case.events,
                "unit": case.unit,
                "rounds": case.rounds,
                "turns_a_round": case.burst,
                "peers": [_peer_json(case, measured, peers[0]) for measured in peers],
            }
            for case, peers in results
        ],
        "notes": list(NOTES),
    }


def machine_of(command: Sequence[str], folder: Path) -> dict[str, Any]:
    """Return on what, with what and when it was measured."""
    from datetime import datetime, timezone

    return {
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "command": " ".join(["python tools/bench.py", *command]),
        "cores": len(os.sched_getaffinity(0)),
        "cpu": _cpu(),
        "file_system": file_system(folder),
        "python": platform.python_version(),
        "sqlite": sqlite3.sqlite_version,
        "versions": {name: found for name in PACKAGES if (found := _version(name))},
    }


def file_system(folder: Path) -> str:
    """Return the type of the file system that holds a folder, such as ext4; "" if unknown."""
    try:
        mounts = [line.split()[1:3] for line in Path("/proc/mounts").read_text().splitlines()]
    except OSError:
        return ""
    here = folder.resolve()
    holders = [(len(at), kind) for at, kind in mounts if here.is_relative_to(at)]
    return max(holders, default=(0, ""))[1]


def _machine_line(machine: dict[str, Any]) -> str:
    versions = [f"{name} {found}" for name, found in machine["versions"].items()]
    parts = (f"{machine['cores']} cores", machine["cpu"], machine["file_system"],
             f"Python {machine['python']}", f"SQLite {machine['sqlite']}", *versions)  # fmt: skip
    return " · ".join(part for part in parts if part)


def _table(results: Sequence[Result]) -> RenderableType:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, width=80)
    table.add_column("")
    for name in ("figure", "times", "promised", "peak MiB"):
        table.add_column(name, justify="right", no_wrap=True)
    for (_, events), group in groupby(
        results, key=lambda result: (result[0].group, result[0].events)
    ):
        if events is not None:
            table.add_row(f"[dim]{events:,} events[/]")
        for case, peers in group:
            n = case.rounds * case.burst
            table.add_row(f"[bold]{case.title}[/]", f"[dim]{case.unit}[/]", f"[dim]n {n}[/]")
            for measured in peers:
                said = f": {measured.problem}" if measured.problem else ""
                table.add_row(f"  {measured.peer.name}{said}", *_cells(case, measured, peers[0]))
        table.add_section()
    return table


def _cells(case: Case, measured: Measured, ours: Measured) -> Iterator[str]:
    if measured.problem:
        return
    yield figure(measured.median_s, case.unit) if measured.agrees else "WRONG"
    yield _times(measured, ours)
    yield measured.peer.promise
    yield f"{measured.peak_bytes / MIB:,.0f}" if case.has_memory else ""


def figure(seconds: float, unit: str) -> str:
    """Return a time per unit as a case shows it, without the unit: `812`, `4.7`, `1,230,000`."""
    if unit == "µs":
        return f"{seconds * 1e6:,.0f}"
    if unit == "ms":
        return f"{seconds * 1e3:,.{1 if seconds < 0.1 else 0}f}"
    rate = 1 / seconds
    return f"{round(rate, 3 - len(str(int(rate)))):,.0f}"


def _times(measured: Measured, ours: Measured) -> str:
    if measured is ours or ours.problem:
        return ""
    times = measured.median_s / ours.median_s
    return f"{times:.{2 if times < 10 else 0}f}x"


def _peer_json(case: Case, measured: Measured, ours: Measured) -> dict[str, Any]:
    said: dict[str, Any] = {"name": measured.peer.name, "promised": measured.peer.promise}
    if measured.problem:
        return {**said, "problem": measured.problem}
    return {
        **said,
        "figure": figure(measured.median_s, case.unit),
        "median_s": measured.median_s,
        "least_s": measured.least_s,
        "times_ours": None if ours.problem else measured.median_s / ours.median_s,
        "peak_bytes": measured.peak_bytes if case.has_memory else None,
        "agrees": measured.agrees,
    }


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
