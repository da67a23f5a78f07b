"""What was measured, as one table or one JSON document."""

from __future__ import annotations

import os
import platform
import sqlite3
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from benchmark.case import Case, Measured
from benchmark.promises import Result, growths, is_kept, memory_kept, speed_kept, times_of

PACKAGES = ("semmap-log", "numpy", "zstandard", "mcap", "mcap-ros2-support", "rosbags", "duckdb",
            "pyarrow", "scipy", "scikit-image")  # fmt: skip

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
mcap, rosbags: the log's first 20,000 events only, scaled per event, and only \
topics that matter to the doors. rosbags does not tell when events happened: it folds them as they \
were recorded, and last_seen is left out. limit: the bytes through crc32 and numpy, nothing made.
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
the map, scaled by area. scipy: costs by exact distances, never less than noetic's. skimage: \
draw.line, with the same ends and as many cells. A door's change: met for the first time; seen \
before: one that the door has made already, large map. plain Python redraws the door's \
surroundings as noetic does, which is not always what the whole map would give; here it is. A \
day: from the log on disk; the opening is part of it.
Beliefs: doors are simulated, but for the clinic's. What visits tell: the log-likelihood of \
121 modes, by the hour; plain Python is the forward algorithm, a loop over visits. One by one: the \
probabilities of every sixth door without learning them side by side, the reading of the log \
included. Schedule: each minute as the midnight before it knew; FreMEn and a table of the hours \
of the week do the same with less to say.
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
