"""Evaluate what thinning costs: how far P(open) moves when old sightings that repeat others go.

    python tools/experiments/eval_thinning.py ../shared/data/doors/*/
    python tools/experiments/eval_thinning.py FOLDER --every 1 --seeds 8 --json

A FOLDER holds doors.csv.gz (timestamp,door,state) and obs_windows.csv (door,start,end), as for
`eval_doors.py`. Each door is looked at again and again while its state is known: after --every
minutes, or (irregular) after as long as chance wants, that on average. A look reads right 90 % of
the time. A log is made of it, the older three quarters are thinned, and P(open) is asked for at
eight moments of the last quarter, before and after, with all that is known. Chance is drawn anew
with each seed; figures are means over seeds, with a standard error. Times are taken as UTC.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import json
import sys
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
from door_eval.paired import standard_error
from numpy.typing import NDArray

import semmap_log as sl
from semmap_log.analysis.beliefs import probabilities
from semmap_log.core.io.clock import KeptClock
from semmap_log.core.model.events import DoorObserved
from semmap_log.log import Thinning, compact, trim_log
from semmap_log.store.reading.reader import LogReader

ESTIMATORS = ("filter", "schedule", "count")
MOMENTS, MINUTE_NS, DAY_NS = 8, 60 * 10**9, 24 * 3600 * 10**9
RIGHT = 0.9
COMMITS_A_DAY = 16

Spans = list[tuple[int, int]]


@dataclass(frozen=True)
class DoorTruth:
    """When a door changed, to what, and when that is known."""

    changed_ns: NDArray[np.int64]
    states: NDArray[np.uint8]
    known: Spans

    def looks(self, every_ns: int, draw: np.random.Generator, *, irregular: bool) -> Looks:
        """Return when somebody looked, and what was read."""
        times = np.concatenate(
            [_times(span, every_ns, draw, irregular=irregular) for span in self.known]
        )
        last = np.searchsorted(self.changed_ns, times, "right") - 1
        times, last = times[last >= 0], last[last >= 0]
        states = self.states[last]
        wrong = draw.random(len(times)) > RIGHT
        return times, np.where(wrong, 3 - states, states).astype("u1")


Looks = tuple[NDArray[np.int64], NDArray[np.uint8]]


def _times(
    span: tuple[int, int], every_ns: int, draw: np.random.Generator, *, irregular: bool
) -> NDArray[np.int64]:
    first, end = span
    if not irregular:
        return np.arange(first + draw.integers(0, every_ns), end, every_ns, np.int64)
    count = int(2 * (end - first) / every_ns) + 20
    times = first + np.cumsum(draw.exponential(every_ns, count)).astype(np.int64)
    return times[times < end]


def main(arguments: Sequence[str] | None = None) -> int:
    """Evaluate the sets that the command line names."""
    options = _parsed(sys.argv[1:] if arguments is None else arguments)
    warnings.simplefilter("ignore")
    found, width = [], max(len(folder.resolve().name) for folder in options.folders)
    if not options.json:
        _print_head(width)
    for folder in options.folders:
        for looks in ("regular", "irregular"):
            name = folder.resolve().name
            found.append({"set": name, "looks": looks, **_evaluated(folder, options, looks)})
            if not options.json:
                _print(found[-1], width)
    if options.json:
        print(json.dumps(found, indent=1))
    return 0


def _evaluated(folder: Path, options: argparse.Namespace, looks: str) -> dict[str, Any]:
    """Return what thinning a set's logs costs: means over seeds."""
    doors = _truths(folder)[: options.doors]
    each = []
    for seed in range(options.seeds):
        print(f"{folder}: {looks}, seed {seed}", end="\r", file=sys.stderr)
        with tempfile.TemporaryDirectory(prefix="eval_thinning_") as room:
            draw = np.random.default_rng(seed)
            log, ends = Path(room, "log"), looks == "irregular"
            found = [one.looks(int(options.every * MINUTE_NS), draw, irregular=ends)
                     for one in doors]  # fmt: skip
            each.append(_thinned(log, found))
    return {
        "doors": len(doors),
        "sightings": float(np.mean([one["sightings"] for one in each])),
        "gone": float(np.mean([one["gone"] for one in each])),
        "bytes_left": float(np.mean([one["bytes_left"] for one in each])),
        **{name: _moved([one[name] for one in each]) for name in ESTIMATORS},
    }


def _moved(by_seed: Sequence[NDArray[np.float64]]) -> dict[str, float]:
    means = [float(np.nanmean(moved)) for moved in by_seed]
    return {
        "mean": float(np.mean(means)),
        "standard_error": standard_error(means) if len(means) > 1 else float("nan"),
        "most": float(np.nanmax(np.concatenate(by_seed))),
    }


def _thinned(log: Path, looks: Sequence[Looks]) -> dict[str, Any]:
    """Write a log of these looks, thin its older part, and return how far P(open) moves."""
    times = np.concatenate([one for one, _ in looks])
    order = np.argsort(times, kind="stable")
    columns = {
        "happened_ns": times[order],
        "state": np.concatenate([states for _, states in looks])[order],
        "door_id": np.repeat(np.arange(1, len(looks) + 1), [len(one) for one, _ in looks])[order],
    }
    _write(log, columns, len(looks))
    compact(log, keep_s=0)
    first_ns, end_ns = int(times.min()), int(times.max())
    until_ns = end_ns - (end_ns - first_ns) // 4
    moments = [until_ns + i * (end_ns - until_ns) // MOMENTS for i in range(1, MOMENTS + 1)]
    before, size = [_asked(log, moments, name) for name in ESTIMATORS], _size(log)
    done = trim_log(log, Thinning(LogReader(log), until_ns)).done
    after = [_asked(log, moments, name) for name in ESTIMATORS]
    moved = (np.abs(a - b).ravel() for a, b in zip(after, before, strict=True))
    return {
        "sightings": len(times), "gone": done.events / len(times), "bytes_left": _size(log) / size,
        **dict(zip(ESTIMATORS, moved, strict=True)),
    }  # fmt: skip


def _write(log: Path, columns: dict[str, NDArray[Any]], doors: int) -> None:
    """Write a log of sightings, as a robot that reports sixteen times a day."""
    times = columns["happened_ns"]
    clock = KeptClock(int(times[0]) - 10**9)
    starts = np.flatnonzero(np.diff(times // (DAY_NS // COMMITS_A_DAY), prepend=-1))
    with sl.create(log, tz="UTC", clock=clock, durability="none", compact=False) as opened:
        for _ in range(doors):
            opened.add_door()
        for first, end in zip(starts, [*starts[1:], len(times)], strict=True):
            clock.recorded_ns = max(clock.recorded_ns, int(times[end - 1]))
            rows = {name: values[first:end] for name, values in columns.items()}
            opened.append(
                sl.EventBatch.of(DoorObserved, accuracy_open=RIGHT, accuracy_closed=RIGHT, **rows)
            )


def _asked(log: Path, moments: Sequence[int], estimator: str) -> NDArray[np.float64]:
    opened = sl.read(log)
    asked = [
        probabilities(opened, at=f"@{at_ns}", estimator=estimator, as_happened=True)
        for at_ns in moments
    ]
    return np.array([[belief.p_open for belief in beliefs] for beliefs in asked])


def _size(log: Path) -> int:
    return sum(path.stat().st_size for path in log.glob("*.mcap"))


def _truths(folder: Path) -> list[DoorTruth]:
    """Return the doors of a set, by name."""
    changes, known = defaultdict(list), defaultdict(list)
    with gzip.open(folder / "doors.csv.gz", "rt") as file:
        for row in csv.DictReader(file):
            state = 1 if row["state"].lower() == "open" else 2
            changes[row["door"]].append((_ns(row["timestamp"]), state))
    with (folder / "obs_windows.csv").open() as file:
        for row in csv.DictReader(file):
            known[row["door"]].append((_ns(row["start"]), _ns(row["end"])))
    return list(_in_order(changes, known))


def _in_order(changes: dict[str, Spans], known: dict[str, Spans]) -> Iterator[DoorTruth]:
    for door in sorted(changes):
        times, states = np.array(sorted(changes[door]), np.int64).T
        yield DoorTruth(times, states.astype("u1"), sorted(known[door]))


def _ns(text: str) -> int:
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone.utc)
    return int(moment.timestamp()) * 10**9


def _print_head(width: int) -> None:
    names = "  ".join(f"{f'|dP| {name}':>26}" for name in ESTIMATORS)
    print(f"{'set':{width}}  looks      sightings  gone  bytes  {names}", flush=True)


def _print(one: dict[str, Any], width: int) -> None:
    cells = "  ".join(f"{_told(one[name]):>26}" for name in ESTIMATORS)
    print(
        f"{one['set']:{width}}  {one['looks']:9}  {one['sightings']:9,.0f}  "
        f"{one['gone']:4.0%}  {one['bytes_left']:5.0%}  {cells}", flush=True
    )  # fmt: skip


def _told(moved: dict[str, float]) -> str:
    return f"{moved['mean']:.4f} ± {moved['standard_error']:.4f}, ≤ {moved['most']:.4f}"


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--every", type=float, default=5, metavar="MIN", help="default: 5")
    parser.add_argument("--doors", type=int, default=8, metavar="N", help="of a set; default: 8")
    parser.add_argument("--seeds", type=int, default=8, metavar="N", help="default: 8")
    parser.add_argument("--json", action="store_true", help="for programs")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
