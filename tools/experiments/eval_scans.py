"""Judge doors by real scans whose truth is known, beside the plain rule on the same visits.

    python tools/experiments/eval_scans.py ../shared/data/scans
    python tools/experiments/eval_scans.py FOLDER... --json > scores.json

A FOLDER holds NAME.npz (stamp s, pose x, y, theta of the laser on the map, range_mm with 0 = no
return, angle rad) and NAME.doors.json (x, y, theta, width, truth OPEN or CLOSED; kind and glass
where they are known).

Counts are visits; those in which the robot drove through count apart. The plain rule says OPEN
where more than half of the beams that came as far as the door's line went through. ECE is over all
visits, decided or not, in ten bins of P(open). Virtual leaves: the state of each open doorway is
drawn anew each minute, and the leaf put into the scans; visits in which it changed, or in which the
robot would have run into it, are left out. Their errors are standard errors over the seeds. Speed
is of one core's time, with the log's own doors.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from scan_eval.packed_logs import PackedLog, Told, packed_logs
from scan_eval.virtual_leaves import WORDS, VirtualDay
from scan_eval.visit_scores import (
    Counts,
    Judged,
    counts,
    ece,
    plain_counts,
    said_accuracy,
    undecided_share,
    worst_bin,
    wrong_share,
)

from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import DoorPlaces, PlacedScan, Visit
from semmap_log.errors import SemmapError

AT_ONCE = 256
Scores = dict[str, Any]


def main() -> int:
    options = _options()
    told = Told(options.max_range, options.sd_xy, radians(options.sd_theta))
    try:
        logs = [PackedLog.read(path) for path in packed_logs(options.folders)]
        found = {log.name: scores(log, told, options.seeds) for log in logs}
    except SemmapError as error:
        print(f"eval_scans: {error}", file=sys.stderr)
        return 1
    print(json.dumps(_finite(found), indent=2) if options.json else table(found))
    return 0


def scores(log: PackedLog, told: Told, seeds: int) -> Scores:
    """Return the figures of a log, and of its doorways with virtual leaves."""
    watched = _Watched.of(log.scans(told), log.doors)
    truths = ["open" if is_open else "closed" for is_open in log.is_open]
    judged = [Judged(visit, truths[visit.door_id - 1]) for visit in watched.visits]
    seen = [j for j in judged if not j.visit.passed]
    through_wall = sum(j.visit.passed and j.truth == "closed" for j in judged)
    closed = counts(seen, "closed")
    closed["OPEN"] += through_wall
    return {
        "open": counts(seen, "open"),
        "closed": closed,
        "passed": len(judged) - len(seen),
        "ece": ece(seen),
        "said_accuracy": said_accuracy(seen),
        "scans_per_s": round(watched.scans_per_s),
        "plain_rule": {word: plain_counts(seen, word) for word in ("open", "closed")},
        "wrong": wrong_share(seen),
        "undecided": undecided_share(seen),
        "worst_bin": worst_bin(seen),
        "scans": len(log.stamps_s),
        "dropped": watched.dropped,
    } | ({"virtual": virtual_scores(log, told, seeds)} if seeds else {})


def virtual_scores(log: PackedLog, told: Told, seeds: int) -> Scores:
    """Return the figures of a log with virtual leaves, over so many seeds."""
    by_seed = [virtual_visits(log, told, seed) for seed in range(seeds)]
    together = [judged for visits in by_seed for judged in visits]
    ajar_open = [_share(counts(visits, "ajar"), "OPEN") for visits in by_seed]
    return {
        **{word: counts(together, word) for word in WORDS},
        "plain_rule": {word: plain_counts(together, word) for word in WORDS},
        "wrong": wrong_share(together),
        "wrong_se": _standard_error([wrong_share(visits) for visits in by_seed]),
        "undecided": undecided_share(together),
        "ajar_open": _share(counts(together, "ajar"), "OPEN"),
        "ajar_open_se": _standard_error(ajar_open),
        "ece": ece(together),
        "worst_bin": worst_bin(together),
        "said_accuracy": said_accuracy(together),
        "seeds": seeds,
    }


def virtual_visits(log: PackedLog, told: Told, seed: int) -> list[Judged]:
    """Return the visits of a log with the virtual leaves of a seed, that have one truth."""
    day = VirtualDay.of(log, seed)
    visits = _Watched.of(log.scans(told, day.ranges), log.doors).visits
    judged = [Judged(visit, day.truth(visit)) for visit in visits if not visit.passed]
    return [j for j in judged if j.truth]


@dataclass(frozen=True, slots=True)
class _Watched:
    """What a watcher made of scans."""

    visits: list[Visit]
    scans_per_s: float
    dropped: dict[str, int]

    @classmethod
    def of(cls, scans: Sequence[PlacedScan], doors: DoorPlaces) -> _Watched:
        watcher = DoorWatcher()
        begin = time.process_time()
        visits: list[Visit] = []
        for start in range(0, len(scans), AT_ONCE):
            visits += watcher.take(scans[start : start + AT_ONCE], doors)
        visits += watcher.close()
        took = time.process_time() - begin
        return cls(visits, len(scans) / max(took, 1e-9), dict(watcher.dropped))


def table(found: Mapping[str, Scores]) -> str:
    """Return the figures as a table for people."""
    return "\n\n".join(_of_log(name, figures) for name, figures in found.items())


def _of_log(name: str, figures: Scores) -> str:
    lines = [
        f"{name}: {figures['scans']:,} scans, {figures['scans_per_s']:,} a second",
        *(f"  dropped, {why}: {count}" for why, count in figures["dropped"].items()),
        f"  {'truth':24}{'OPEN':>8}{'UNKNOWN':>9}{'CLOSED':>8}    plain rule",
        *_rows(figures, ("open", "closed"), ""),
        f"  driven through: {figures['passed']}",
        _summary(figures),
    ]
    virtual = figures.get("virtual")
    if virtual:
        lines += [
            *_rows(virtual, WORDS[::-1], "virtual leaf "),
            _summary(virtual),
            f"  wrong {_with_error(virtual, 'wrong')}; ajar read OPEN "  # noqa: ISC004
            f"{_with_error(virtual, 'ajar_open')}; {virtual['seeds']} seeds",
        ]
    return "\n".join(lines)


def _rows(figures: Scores, words: Sequence[str], before: str) -> list[str]:
    return [_row(f"{before}{w}", figures[w], figures["plain_rule"][w]) for w in words]


def _row(name: str, read: Counts, plain: Counts) -> str:
    ours = f"{read['OPEN']:8}{read['UNKNOWN']:9}{read['CLOSED']:8}"
    return f"  {name:24}{ours}    {plain['OPEN']} / {plain['UNKNOWN']} / {plain['CLOSED']}"


def _summary(figures: Scores) -> str:
    return (
        f"  decided visits: {figures['wrong']:.2%} wrong, said accuracy "
        f"{figures['said_accuracy']:.4f}, was {1 - figures['wrong']:.4f}; undecided "
        f"{figures['undecided']:.1%}; ECE {figures['ece']:.4f}, "
        f"worst bin {figures['worst_bin']:.2f}"
    )


def _with_error(figures: Scores, name: str) -> str:
    return f"{figures[name]:.2%} +- {figures[f'{name}_se']:.2%}"


def _share(read: Counts, state: str) -> float:
    total = sum(read.values())
    return read[state] / total if total else math.nan


def _standard_error(values: Sequence[float]) -> float:
    """Return the standard error of their mean; NaN: fewer than two of them are numbers."""
    known = [value for value in values if not math.isnan(value)]
    if len(known) < 2:
        return math.nan
    return float(np.std(known, ddof=1) / math.sqrt(len(known)))


def _finite(value: Any) -> Any:
    """Return the same with null for what is not a number."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", metavar="FOLDER", type=Path, nargs="+", help="packed logs")
    parser.add_argument("--json", action="store_true", help="one document instead of tables")
    parser.add_argument(
        "--seeds", metavar="N", type=int, default=8, help="of virtual leaves; 8; 0: none"
    )
    parser.add_argument("--sd-xy", metavar="M", type=float, default=0.03, help="of the poses; 0.03")
    parser.add_argument(
        "--sd-theta", metavar="DEG", type=float, default=0.5, help="of the headings; 0.5"
    )
    parser.add_argument(
        "--max-range", metavar="M", type=float, default=65.0, help="of the laser; 65"
    )
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
