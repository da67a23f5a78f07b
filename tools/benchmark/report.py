"""What was measured, against what was promised: as a table, or one JSON document."""

from __future__ import annotations

import os
import platform
import re
import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby
from operator import ge, gt, le, lt
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console, RenderableType
from rich.markup import escape
from rich.table import Table

from benchmark.case import Case, Measured
from benchmark.peers import MCAP, OURS

Result = tuple[Case, list[Measured]]

MEMORY_MB = 200
"""Peak memory of whatever we do, the log as long as it may be: below this."""
MB = 10**6

_PROMISE = re.compile(r"(?P<sign>[≥≤<>]) (?P<bound>[\d.]+) ?(x|ms|%)")
_SIGNS = {"≥": ge, "≤": le, "<": lt, ">": gt}


@dataclass(frozen=True, slots=True)
class Growth:
    """How much longer a peer takes for the same in a larger log."""

    title: str
    peer: str
    from_events: int
    to_events: int
    times: float
    promise: str


def is_kept(promise: str, value: float | None) -> bool | None:
    """Tell whether a value is what was promised; None: nothing was, or there is no value.

    Args:
        promise: Such as `≥ 80x`, `< 150 ms`, `< 1 %`.
        value: In the unit of the promise.
    """
    if not promise or value is None:
        return None
    match = _PROMISE.fullmatch(promise)
    assert match is not None, promise
    return bool(_SIGNS[match["sign"]](value, float(match["bound"])))


def times_of(measured: Measured, peers: Sequence[Measured]) -> float | None:
    """Return how often our time goes into a peer's; None: it is compared with nobody."""
    ours = peers[measured.peer.beside]
    if measured is ours or measured.problem or ours.problem:
        return None
    return measured.median_s / ours.median_s


def speed_kept(measured: Measured, peers: Sequence[Measured]) -> bool | None:
    """Tell whether a peer's time, or how it stands to ours, is what was promised."""
    if measured.problem:
        return None
    promise = measured.peer.promise
    in_ms = promise.endswith("ms")
    return is_kept(promise, measured.median_s * 1e3 if in_ms else times_of(measured, peers))


def memory_kept(case: Case, measured: Measured) -> bool | None:
    """Tell whether we stayed below `MEMORY_MB`, or the case's own; None: that is not asked."""
    asked = case.has_memory and case.memory_promise and measured.peer.name.startswith(OURS)
    if not asked or measured.problem:
        return None
    return measured.peak_bytes < (case.memory_mb or MEMORY_MB) * MB


def growths(results: Sequence[Result]) -> Iterator[Growth]:
    """Yield how each peer's time grew from the smallest log to the largest."""
    keys = list(dict.fromkeys(case.key for case, _ in results if case.growth_promise is not None))
    for key in keys:
        sized = sorted(((case.events or 0, case, peers) for case, peers in results
                        if case.key == key), key=lambda one: one[0])  # fmt: skip
        least, case, small = sized[0]
        most, _, large = sized[-1]
        if least == most:
            continue
        known = {one.peer.name: one.median_s for one in small if not one.problem}
        for one in large:
            if not one.problem and one.peer.name in known and one.peer.name != MCAP:
                promise = case.growth_promise if one.peer.name.startswith(OURS) else ""
                times = one.median_s / known[one.peer.name]
                yield Growth(case.title, one.peer.name, least, most, times, promise or "")


PACKAGES = ("semmap-log", "numpy", "zstandard", "mcap", "mcap-ros2-support", "duckdb", "pyarrow",
            "scipy")  # fmt: skip

NOTES = """\
Medians of n turns, taken by the peers in rounds (A B A B; slow ones take fewer turns a round); a \
first round warms up and does not count. Each peer has a process of its own: peak MiB is the most \
that it had while it worked, with interpreter, libraries and mapped pages of files.
times: how often our time goes into the peer's; above 1x we are ahead. A peer on 2 cores stands \
beside us on 2 cores. promised: DESIGN section 9 and what the issues ask for.
Every answer is compared with one found in another way (a plain fold of the same events, the rows \
or bytes given); where it differs, the figure is WRONG.
Logs: 100 doors, an event every 10 s, 2 % of them told up to an hour late. live: as it was \
written; plain, zstd: compacted, in chunks of about a MiB. Whole log: every event read, checked \
and folded; State now: opened and asked, where a keyframe helps.
mcap: the log's first 20,000 events only, scaled per event, and only topics that matter to the \
doors. limit: the bytes through crc32 and numpy, nothing made.
SQLite, DuckDB: given the events as a table of what each of them sets, written beforehand: Parquet \
with zstd, sorted by number; SQLite with nine indexes, one for each question. Daily \
snapshots: a DuckDB file with the events in the order in which they happened, and the doors at \
each midnight. They check no CRC. \
All read from the page cache, but for Moment, cold: opened anew, its pages dropped; read: what \
came from the disk, of the whole; the kernel reads more than it is asked for (read-ahead).
In a store: moto's server beside us, which is Python: read bytes and requests, not times. Just \
opened: manifest and all, nothing kept from before.
A fleet: 5,000 sightings a log; Dask's workers run already, a process a core. One by one: in one \
process, whose reader uses all cores, too.
One day: a 365th of the log's time. append: commits are given as event objects, as bytes, as rows.
Costmap: a made-up building with up to 500 doors, cells of 0.05 m, inflation of 0.55 m, from \
nothing to the master. plain Python: the thesis's and noetic's loops over cells, on a corner of \
the map, scaled by area. scipy: costs by exact distances, never less than noetic's. A door's \
change: met for the first time; seen \
before: one that the door has made already, large map. plain Python redraws the door's \
surroundings as noetic does, which is not always what the whole map would give; here it is. A \
day: from the log on disk; the opening is part of it.
Beliefs: doors are simulated, but for the clinic's. What visits tell: the log-likelihood of \
121 modes, by the hour; plain Python is the forward algorithm, a loop over visits. One by one: the \
probabilities of every sixth door without learning them side by side, the reading of the log \
included.
""".splitlines()


def to_json(results: Sequence[Result], machine: dict[str, Any]) -> dict[str, Any]:
    """Return what was measured as one document; times in seconds per unit, memory in bytes."""
    return {
        **machine,
        "cases": [
            {
                "group": case.group,
                "title": case.title,
                "key": case.key,
                "events": case.events,
                "unit": case.unit,
                "rounds": case.rounds,
                "turns_a_round": case.burst,
                "peers": [_peer_json(case, measured, peers) for measured in peers],
            }
            for case, peers in results
        ],
        "growth": [
            {
                "title": growth.title,
                "name": growth.peer,
                "from_events": growth.from_events,
                "to_events": growth.to_events,
                "times": growth.times,
                "promised": growth.promise,
                "kept": is_kept(growth.promise, growth.times),
            }
            for growth in growths(results)
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
        "read_ahead_kib": _read_ahead_kib(folder),
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


def figure(seconds: float, unit: str) -> str:
    """Return a time per unit as a case shows it, without the unit: `812`, `4.7`, `1,230,000`."""
    if unit == "µs":
        return f"{seconds * 1e6:,.0f}"
    if unit == "ms":
        digits = 2 if seconds < 0.001 else 1 if seconds < 0.1 else 0
        return f"{seconds * 1e3:,.{digits}f}"
    rate = 1 / seconds
    return f"{round(rate, 3 - len(str(int(rate)))):,.0f}"


def _peer_json(case: Case, measured: Measured, peers: Sequence[Measured]) -> dict[str, Any]:
    said: dict[str, Any] = {"name": measured.peer.name, "promised": measured.peer.promise}
    if measured.problem:
        return {**said, "problem": measured.problem}
    said |= {
        "figure": figure(measured.median_s, case.unit),
        "turns": len(measured.seconds),
        "median_s": measured.median_s,
        "least_s": measured.least_s,
        "median_cpu_s": measured.cpu_s,
        "times_ours": times_of(measured, peers),
        "beside": peers[measured.peer.beside].peer.name,
        "kept": speed_kept(measured, peers),
        "peak_bytes": measured.peak_bytes if case.has_memory else None,
        "memory_kept": memory_kept(case, measured),
        "agrees": measured.agrees,
    }
    if measured.note:
        said["note"] = measured.note
    if case.tail_promise is not None:
        said["p99_s"], said["worst_s"] = measured.p99_s, measured.worst_s
    if measured.peer.store_bytes:
        said["share_read"] = measured.share_read
    return said


def _read_ahead_kib(folder: Path) -> int | None:
    """Return how much the kernel reads where one page of a file is touched; None: not to be seen.

    What a cold moment reads from the disk is a multiple of it.
    """
    device = folder.stat().st_dev
    place = Path(f"/sys/dev/block/{os.major(device)}:{os.minor(device)}")
    files = (place / "queue/read_ahead_kb", place / "../queue/read_ahead_kb")
    return next((int(file.read_text()) for file in files if file.exists()), None)


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


WIDTH = 80
MIB = 2**20

Row = tuple[str, ...]


def show(results: Sequence[Result], machine: dict[str, Any]) -> None:
    """Print the table on stdout."""
    console = Console(width=WIDTH, highlight=False)
    console.print(_machine_line(machine))
    console.print(f"{machine['date']}   {machine['command']}", style="dim")
    console.print(_table(results))
    console.print(f"Temporary files: {machine['disk_bytes'] / MIB:,.0f} MiB at most.", style="dim")
    for note in NOTES:
        console.print(f"- {note}", style="dim")


def _machine_line(machine: dict[str, Any]) -> str:
    versions = [f"{name} {found}" for name, found in machine["versions"].items()]
    ahead = machine["read_ahead_kib"]
    disk = f"{machine['file_system']}, read-ahead {ahead} KiB" if ahead else machine["file_system"]
    parts = (f"{machine['cores']} cores", machine["cpu"], disk,
             f"Python {machine['python']}", f"SQLite {machine['sqlite']}", *versions)  # fmt: skip
    return " · ".join(part for part in parts if part)


def _table(results: Sequence[Result]) -> RenderableType:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, width=WIDTH)
    table.add_column("")
    for name in ("figure", "times", "promised", "peak MiB"):
        table.add_column(name, justify="right", no_wrap=True)
    for (_, events), group in groupby(
        results, key=lambda result: (result[0].group, result[0].events)
    ):
        if events is not None:
            table.add_row(f"[dim]{events:,} events[/]")
        for case, peers in group:
            for row in _case_rows(case, peers):
                table.add_row(*row)
        table.add_section()
    for (least, most), grown in groupby(
        growths(results), key=lambda growth: (growth.from_events, growth.to_events)
    ):
        table.add_row(f"[bold]Growth of a moment's time[/]\n[dim]{least:,} to {most:,} events[/]")
        for growth in grown:
            table.add_row(*_growth_row(growth))
    return table


def _case_rows(case: Case, peers: Sequence[Measured]) -> Iterator[Row]:
    turns = max(len(measured.seconds) for measured in peers)
    yield f"[bold]{case.title}[/]", f"[dim]{case.unit}[/]", f"[dim]n {turns}[/]"
    for measured in peers:
        yield from _peer_rows(case, measured, peers)


def _peer_rows(case: Case, measured: Measured, peers: Sequence[Measured]) -> Iterator[Row]:
    name = f"  {escape(measured.peer.name)}"
    if measured.problem:
        yield (f"{name}: {escape(measured.problem)}",)
        return
    said = figure(measured.median_s, case.unit) if measured.agrees else "[bold red]WRONG[/]"
    promise = _marked(measured.peer.promise, kept=speed_kept(measured, peers))
    yield name, said, _times(times_of(measured, peers)), promise, _memory(case, measured)
    if measured.note:
        yield (f"[dim]    {escape(measured.note)}[/]",)
    is_ours = measured.peer.name.startswith(OURS)
    if case.tail_promise is not None:
        tails = (("p99", measured.p99_s, case.tail_promise),
                 ("worst", measured.worst_s, case.worst_promise))  # fmt: skip
        for name, seconds, promise in tails:
            kept = is_kept(promise, seconds * 1e3) if is_ours else None
            promised = _marked(promise if is_ours else "", kept=kept)
            yield f"[dim]    {name}[/]", figure(seconds, case.unit), "", promised
    if (share := measured.share_read) is not None:
        kept = is_kept(case.share_promise, share * 100) if is_ours else None
        promised = case.share_promise if is_ours else ""
        yield "[dim]    read[/]", f"{share:.2%}", "", _marked(promised, kept=kept)


def _growth_row(growth: Growth) -> Row:
    how = growth.title.split(", ")[1]
    kept = is_kept(growth.promise, growth.times)
    return (f"  {escape(growth.peer)}, {how}", f"{growth.times:,.3g}x", "",
            _marked(growth.promise, kept=kept))  # fmt: skip


def _memory(case: Case, measured: Measured) -> str:
    if not case.has_memory:
        return ""
    kept = memory_kept(case, measured)
    mark = "[red]![/]" if kept is False else ""
    return f"{mark}{measured.peak_bytes / MIB:,.0f}"


def _marked(promise: str, *, kept: bool | None) -> str:
    if kept is None:
        return promise
    return f"{promise} [green]✓[/]" if kept else f"{promise} [red]✗[/]"


def _times(times: float | None) -> str:
    return "" if times is None else f"{times:,.{2 if times < 10 else 0}f}x"
