"""Judge what a laser tells of doors, in simulated buildings where the truth is known.

    python tools/experiments/eval_sim_scans.py  eight patrols of ten minutes: some minutes
    python tools/experiments/eval_sim_scans.py --seeds 1..2 --minutes 4
    python tools/experiments/eval_sim_scans.py --draw wrong/  pictures of the visits that went wrong
    python tools/experiments/eval_sim_scans.py --json > scores.json
    python tools/experiments/eval_sim_scans.py --visits visits.jsonl    each visit with its truth

The same scans are judged with several localisations: 5 cm and 1 degree told, 10 cm and 2 degrees
told, and 20 cm and 4 degrees not told (the model takes its own default for it). The truth of a
visit is how the door stood meanwhile; visits in which it moved are left out and counted. Beside the
estimator stands the plain rule on the same visits: open if more than half of the beams that came as
far as the door's line went through it. Doors of glass, which the estimator is told of, have a row
of their own. Errors are standard errors over patrols.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from patrol_sim.laser_judging import Judged, Pose, judged
from patrol_sim.laser_picture import around, drawn
from patrol_sim.laser_plan import LevelPlan, read_plan
from patrol_sim.laser_pose import PoseError, localised
from patrol_sim.laser_sensor import Laser
from patrol_sim.laser_surfaces import Floats
from patrol_sim.laser_world import Patrol, SimScan, World, simulated
from scan_eval.ratios import Estimate, ratio

from semmap_log.errors import SemmapError

ROOT = Path(__file__).resolve().parents[2]
POSES = (
    Pose("5 cm, 1 deg, told", PoseError(0.05, 1.0), told=True),
    Pose("10 cm, 2 deg, told", PoseError(0.10, 2.0), told=True),
    Pose("20 cm, 4 deg, not told", PoseError(0.20, 4.0), told=False),
)
BUILDINGS = (("rmf_clinic/clinic", 1), ("rmf_clinic/clinic", 2), ("rmf_hotel/hotel", 2))
"""Patrols take turns in these: plan, level."""
GROUPS = ("closed", "ajar", "slid", "open")
WORLD = World(shares=(0.35, 0.30, 0.35))
"""More doors are ajar than elsewhere: they are the hard ones."""
WORDS = ("OPEN", "UNKNOWN", "CLOSED")
BINS = 10
MANY = 30
"""A bin with fewer visits is not judged."""
Score = dict[str, Any]


def main() -> int:
    args = _options()
    plans: dict[tuple[str, int], LevelPlan] = {}
    visits: list[Judged] = []
    try:
        for seed in args.seeds:
            name, level = BUILDINGS[seed % len(BUILDINGS)]
            if (name, level) not in plans:
                plans[name, level] = read_plan(args.maps / f"{name}.building.yaml", level)
            visits += _patrolled(plans[name, level], seed, args)
    except SemmapError as error:
        print(f"eval_sim_scans: {error}", file=sys.stderr)
        return 1
    if args.visits:
        rows = [json.dumps({**asdict(v), "looks": float(v.looks)}) for v in visits]
        args.visits.write_text("\n".join(rows) + "\n", encoding="utf-8")
    found = {pose.name: scores([v for v in visits if v.pose == pose.name]) for pose in POSES}
    if args.json:
        print(json.dumps(found, indent=2))
    else:
        _print(found)
    return 0


def _patrolled(plan: LevelPlan, seed: int, args: argparse.Namespace) -> list[Judged]:
    """Simulate a patrol, and judge all visits that the estimator makes of it."""
    began = time.monotonic()
    laser = Laser(hz=args.hz)
    patrol = simulated(plan, WORLD, laser, seed=seed, minutes=args.minutes,
                       progress=_bar(f"seed {seed}: driving"))  # fmt: skip
    scans = list(patrol.scanned(_bar(f"seed {seed}: scanning")))
    visits = []
    for pose in POSES:
        where = localised(patrol.track, pose.error, seed=seed)
        made = judged(patrol, scans, where, pose)
        visits += made
        if args.draw:
            _draw_wrong(patrol, scans, where.believed, made, args.draw)
    took_s = time.monotonic() - began
    print(f"\rseed {seed}: {len(scans):,} scans, {len(visits) // len(POSES)} visits, "
          f"{took_s:.0f} s", file=sys.stderr)  # fmt: skip
    return visits


def scores(visits: Sequence[Judged]) -> Score:
    """Return the figures of one localisation."""
    still = [v for v in visits if not v.moved and not v.passed]
    seen = [v for v in still if v.in_view]
    glass, solid = ([v for v in seen if v.glass == glass] for glass in (True, False))
    calibration = [
        v for v in still
        if v.group in {"open", "closed"} and not v.glass and not math.isnan(v.p_open)
    ]  # fmt: skip
    return {
        "visits": len(visits),
        "moved": sum(v.moved for v in visits),
        "passed": {"right": sum(v.passed and v.truly_passed for v in visits),
                   "wrong": sum(v.passed and not v.truly_passed for v in visits)},
        "groups": {group: _group([v for v in solid if v.group == group]) for group in GROUPS},
        "ajar_towards": _group([v for v in solid if v.group == "ajar" and v.towards]),
        "ajar_away": _group([v for v in solid if v.group == "ajar" and not v.towards]),
        "glass": {group: _group([v for v in glass if v.group == group]) for group in GROUPS},
        "hardly_in_view": _group([v for v in still if not v.in_view]),
        "hardly_in_view_wrong": sum(_is_wrong(v) for v in still if not v.in_view),
        "ece": _ece(calibration),
        "brier": _brier(calibration),
        "worst_bin": max((abs(b["said"] - b["was"]) for b in _bins(calibration)
                          if b["visits"] >= MANY), default=math.nan),
        "bins": _bins(calibration),
        "decided": _decided(calibration),
    }  # fmt: skip


def _is_wrong(v: Judged) -> bool:
    """Tell whether a visit was read the other way round, or a door that is ajar OPEN."""
    return (v.group, v.state) in {("closed", "OPEN"), ("open", "CLOSED"), ("ajar", "OPEN")}


def _group(visits: Sequence[Judged]) -> Score:
    """Return how often visits of one truth were read how, by both."""
    return {
        "visits": len(visits),
        "estimator": {word: _share(visits, lambda v, w=word: v.state == w) for word in WORDS},
        "plain_rule": {word: _share(visits, lambda v, w=word: v.plain == w) for word in WORDS},
    }  # fmt: skip


def _share(visits: Sequence[Judged], is_so: Callable[[Judged], bool]) -> Estimate:
    """Return the share of visits, and its standard error over patrols."""
    seeds = sorted({v.seed for v in visits})
    return ratio(
        [sum(is_so(v) for v in visits if v.seed == seed) for seed in seeds],
        [sum(v.seed == seed for v in visits) for seed in seeds],
    )


def _bins(visits: Sequence[Judged]) -> list[dict[str, float]]:
    said = np.array([v.p_open for v in visits])
    was = np.array([v.group == "open" for v in visits], float)
    place = np.minimum((said * BINS).astype(int), BINS - 1)
    return [
        {"visits": int((place == b).sum()), "said": float(said[place == b].mean()),
         "was": float(was[place == b].mean())}
        for b in range(BINS) if (place == b).any()
    ]  # fmt: skip


def _ece(visits: Sequence[Judged]) -> float:
    bins = _bins(visits)
    total = sum(b["visits"] for b in bins)
    return sum(b["visits"] * abs(b["said"] - b["was"]) for b in bins) / total if total else math.nan


def _brier(visits: Sequence[Judged]) -> float:
    return float(np.mean([(v.p_open - (v.group == "open")) ** 2 for v in visits]))


def _decided(visits: Sequence[Judged]) -> dict[str, float]:
    """Return how sure decided visits are, and how often they are right."""
    some = [v for v in visits if v.state != "UNKNOWN"]
    right = [v.state.lower() == v.group for v in some]
    return {
        "visits": len(some), "said": float(np.mean([v.accuracy for v in some])),
        "was": float(np.mean(right)),
    }  # fmt: skip


def _print(found: dict[str, Score]) -> None:
    for name, score in found.items():
        print(f"\n{name}: {score['visits']} visits, {score['moved']} left out (the door moved); "
              f"driven through {score['passed']}")  # fmt: skip
        print(f"{'truth':<16}{'visits':>7}   {'estimator':<60}plain rule")
        for title, row in _rows(score):
            print(f"{title:<16}{row['visits']:>7}   "
                  f"{_words(row['estimator']):<60}{_words(row['plain_rule'])}")  # fmt: skip
        hardly = score["hardly_in_view"]
        print(f"{'hardly in view':<16}{hardly['visits']:>7}   "
              f"wrong: {score['hardly_in_view_wrong']}")  # fmt: skip
        decided = score["decided"]
        print(f"ECE {score['ece']:.4f}  Brier {score['brier']:.4f}  worst bin of >= {MANY}: "
              f"{score['worst_bin']:.3f}; decided {decided['visits']}: "
              f"said {decided['said']:.4f}, was {decided['was']:.4f}")  # fmt: skip
        for b in score["bins"]:
            print(f"   said {b['said']:.3f}  was {b['was']:.3f}  of {b['visits']}")


def _rows(score: Score) -> Iterator[tuple[str, Score]]:
    for group in GROUPS:
        yield group, score["groups"][group]
        if group == "ajar":
            yield "  leaf towards", score["ajar_towards"]
            yield "  leaf away", score["ajar_away"]
    for group in GROUPS:
        yield f"glass, {group}", score["glass"][group]


def _words(shares: dict[str, Estimate]) -> str:
    return "  ".join(
        f"{word} {100 * share:.1f} +- {100 * error:.1f}" for word, (share, error) in shares.items()
    )


def _draw_wrong(
    patrol: Patrol, scans: Sequence[SimScan], believed: Floats, visits: Iterable[Judged],
    folder: Path,
) -> None:  # fmt: skip
    """Draw each visit that was read the other way round, and ajar doors read OPEN."""
    folder.mkdir(parents=True, exist_ok=True)
    for v in visits:
        if not _is_wrong(v) or v.moved or v.passed:
            continue
        middle = np.mean(patrol.lives[v.door_id].body.ends, axis=0)
        its = [scan for scan in scans if v.first_s <= scan.at_s <= v.last_s]
        image = drawn(patrol, around(middle, 3.5), at_s=v.first_s, scans=its, believed=believed)
        pose = v.pose.replace(" ", "").replace(",", "_")
        image.save(folder / f"{v.group}_{v.state}_{pose}_{v.seed}_{v.door_id}_{v.first_s:.0f}.png")


def _bar(what: str) -> Callable[[float], None]:
    def tell(share: float) -> None:
        if sys.stderr.isatty():
            print(f"\r{what} {share:.0%} ", end="", file=sys.stderr)

    return tell


def _seeds(text: str) -> list[int]:
    first, _, last = text.partition("..")
    return list(range(int(first), int(last or first) + 1))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=_seeds, default=_seeds("1..8"), help="default: 1..8")
    parser.add_argument("--minutes", type=float, default=10, help="of each patrol; default: 10")
    parser.add_argument("--hz", type=float, default=10, help="scans a second; default: 10")
    parser.add_argument("--json", action="store_true", help="one document on stdout")
    parser.add_argument("--visits", type=Path, help="file for all visits, as JSON lines")
    parser.add_argument("--draw", type=Path, help="folder for pictures of visits that went wrong")
    parser.add_argument("--maps", type=Path, default=ROOT.parent / "shared/data/maps",
                        help="folder with the Open-RMF plans; default: %(default)s")  # fmt: skip
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
