"""What is a week of patrols with a laser worth, beside a week in which the truth was told?

    python tools/experiments/eval_sim_week.py  eight weeks of the clinic's second level
    python tools/experiments/eval_sim_week.py --seeds 1..2 --json

The doors live by the habits of `recordings/clinic_week`. Eight times a day a robot drives past them
and scans; what the estimator makes of it goes into one log, and how the doors really stood at the
same visits, told with certainty, into another. Both logs learn, and both forecast each door every
other hour from the second day on: `live` knows all up to then, `habit` all up to the midnight
before. The figure is the difference of their Brier scores against the truth, with its standard
error over weeks. Undecided visits are told as UNKNOWN, which is no evidence.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from patrol_sim.habits import HOUR_NS, DoorTruth, habit_of, live
from patrol_sim.journal import Entry, Journal, write
from patrol_sim.laser_doors import DoorLife, standing
from patrol_sim.laser_judging import Pose, door_places, placed_scans
from patrol_sim.laser_people import people_of
from patrol_sim.laser_plan import read_plan
from patrol_sim.laser_pose import PoseError, localised
from patrol_sim.laser_sensor import Laser
from patrol_sim.laser_world import START_NS, Patrol, World, simulated

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved, DoorPassed, Event
from semmap_log.errors import SemmapError

ROOT = Path(__file__).resolve().parents[2]
TZ = "Europe/Vienna"
MONDAY_NS = START_NS - 10 * HOUR_NS
"""Local midnight with which the week begins."""
DAYS = 7
ROUNDS_H = (0, 6, 8, 10, 12, 14, 16, 20)
STARTS_NS = 10 * 60 * 10**9
"""A round starts so long after its hour; forecasts are made on the hour."""
EVERY_H = 2
POSE = Pose("5 cm, 1 deg, told", PoseError(0.05, 1.0), told=True)
BUILDING, LEVEL = "rmf_clinic/clinic", 2
Truths = dict[DoorId, DoorTruth]


def main() -> int:
    args = _options()
    found = []
    try:
        for seed in args.seeds:
            found.append(week(seed, args))
            print(f"seed {seed}: {_told(found[-1])}", file=sys.stderr, flush=True)
    except SemmapError as error:
        print(f"eval_sim_week: {error}", file=sys.stderr)
        return 1
    if args.json:
        print(json.dumps(found, indent=2))
        return 0
    for what in ("live", "habit"):
        scans, truth = (np.array([week[what][log] for week in found]) for log in ("scans", "truth"))
        more = scans - truth
        error = more.std(ddof=1) / math.sqrt(len(more)) if len(more) > 1 else math.nan
        print(f"{what:<6} Brier from scans {scans.mean():.4f}, from the truth {truth.mean():.4f}: "
              f"{more.mean():+.4f} +- {error:.4f}")  # fmt: skip
    return 0


def week(seed: int, args: argparse.Namespace) -> dict[str, object]:
    """Simulate a week, learn from it twice, and return the Brier scores."""
    began = time.monotonic()
    patrol = _round(seed, args)
    rng = random.Random(seed)
    ends_ns = MONDAY_NS + DAYS * 24 * HOUR_NS
    truths = {
        door.door_id: live(habit_of(door.name, rng), MONDAY_NS, ends_ns, rng)
        for door in patrol.plan.doors
    }
    seen: list[Event] = []
    told: list[Event] = []
    for number, starts_ns in enumerate(_starts()):
        for visit in _visits(patrol, truths, starts_ns, seed * 1000 + number):
            seen += _events(visit)
            if not visit.passed:
                state = truths[visit.door_id].state(visit.last_ns)
                told.append(
                    DoorObserved(happened_ns=visit.last_ns, door_id=visit.door_id, state=state)
                )
    decided = sum(isinstance(e, DoorObserved) and e.state is not DoorState.UNKNOWN for e in seen)
    doors = sorted({event.door_id for event in told if isinstance(event, DoorObserved)})
    with tempfile.TemporaryDirectory(prefix="eval_sim_week_") as folder:
        logs = {"scans": seen, "truth": told}
        scores = {
            name: _scores(_log(Path(folder, name), patrol, events), truths, doors)
            for name, events in logs.items()
        }
    return {
        "seed": seed, "doors": len(doors), "visits": len(told), "decided": decided,
        "seconds": round(time.monotonic() - began, 1),
        **{what: {name: scores[name][what] for name in logs} for what in ("live", "habit")},
    }  # fmt: skip


def _round(seed: int, args: argparse.Namespace) -> Patrol:
    """Return one round through the corridors, which is driven again and again."""
    plan = read_plan(args.maps / f"{BUILDING}.building.yaml", LEVEL)
    world = World(shares=(1, 0, 0), changes_per_hour=0, asks=0, glass_doors=0)
    laser = Laser(hz=args.hz)
    return simulated(plan, world, laser, seed=seed, minutes=args.minutes)


def _starts() -> Iterator[int]:
    for day in range(DAYS):
        for hour in ROUNDS_H:
            yield MONDAY_NS + (day * 24 + hour) * HOUR_NS + STARTS_NS


def _visits(patrol: Patrol, truths: Truths, starts_ns: int, seed: int) -> list[Visit]:
    """Drive a round at that moment, and return what the estimator makes of its scans."""
    lives = {
        door_id: _life(patrol.lives[door_id], truth, starts_ns, patrol.length_s)
        for door_id, truth in truths.items()
    }
    people = people_of(patrol.track, list(lives.values()), walkers_per_min=1, in_doorway=0.08,
                       rng=np.random.default_rng([seed, 1]))  # fmt: skip
    this = replace(patrol, seed=seed, lives=lives, people=people)
    where = localised(this.track, POSE.error, seed=seed)
    scans = [
        replace(scan, stamp_ns=scan.stamp_ns - START_NS + starts_ns)
        for scan in placed_scans(this, list(this.scanned()), where, POSE)
    ]
    watcher = DoorWatcher()
    return [*watcher.take(scans, door_places(this)), *watcher.close()]


def _life(still: DoorLife, truth: DoorTruth, starts_ns: int, length_s: float) -> DoorLife:
    """Return how a door stands while a round goes on."""
    life = DoorLife(still.body, _amounts(still, truth, starts_ns))
    for at_ns, _ in truth.changes(starts_ns, starts_ns + round(length_s * 1e9)):
        life.change((at_ns - starts_ns) / 1e9, _amounts(still, truth, at_ns))
    return life


def _amounts(still: DoorLife, truth: DoorTruth, at_ns: int) -> tuple[float, float]:
    """Return how far it is open: chosen anew each time that it is opened or shut."""
    changed_s = truth.last_change_ns(at_ns) // 10**9
    rng = np.random.default_rng([still.body.drawn.door_id, changed_s])
    return standing(still.body, truth.state(at_ns).name, rng)


def _events(visit: Visit) -> Iterator[Event]:
    if visit.passed:
        yield DoorPassed(happened_ns=visit.last_ns, door_id=visit.door_id, passed=True, waited_s=0)
        return
    yield DoorObserved(
        happened_ns=visit.last_ns, door_id=visit.door_id, state=visit.state,
        accuracy_open=visit.accuracy, accuracy_closed=visit.accuracy,
    )  # fmt: skip


def _log(path: Path, patrol: Patrol, events: Iterable[Event]) -> sl.DoorLog:
    """Return a log of the plan and these events, each recorded as it happened."""
    journal = Journal()
    journal.add(MONDAY_NS - HOUR_NS, *patrol.plan.events)
    for event in events:
        assert event.happened_ns is not None
        journal.add(event.happened_ns, event)
    journal.settle()
    write(path, journal, tz=TZ, robot="robot", building="clinic", rng=random.Random(0),
          progress=_as_is)  # fmt: skip
    return sl.read(path)


def _as_is(entries: Sequence[Entry]) -> Iterable[Entry]:
    return entries


def _scores(log: sl.DoorLog, truths: Truths, doors: Sequence[DoorId]) -> dict[str, float]:
    """Return the Brier scores of forecasts on every other hour from the second day on."""
    live_sum, habit_sum, count = 0.0, 0.0, 0
    for day in range(1, DAYS):
        midnight_ns = MONDAY_NS + day * 24 * HOUR_NS
        for hour in range(1, 24, EVERY_H):
            at_ns = midnight_ns + hour * HOUR_NS
            was = np.array([truths[door].state(at_ns) is DoorState.OPEN for door in doors], float)
            now = _p_open(log, doors, known_at=at_ns, horizon_ns=0)
            ahead = _p_open(log, doors, known_at=midnight_ns, horizon_ns=hour * HOUR_NS)
            live_sum += float(((now - was) ** 2).sum())
            habit_sum += float(((ahead - was) ** 2).sum())
            count += len(doors)
    return {"live": live_sum / count, "habit": habit_sum / count}


def _p_open(
    log: sl.DoorLog, doors: Sequence[DoorId], *, known_at: int, horizon_ns: int
) -> np.ndarray:
    estimator = "schedule" if horizon_ns else None
    said = probabilities(
        log, known_at=known_at, horizon_ns=horizon_ns, estimator=estimator, doors=doors
    )
    return np.array([belief.p_open for belief in said])


def _told(found: dict[str, object]) -> str:
    return ", ".join(f"{key} {value}" for key, value in found.items() if key != "seed")


def _seeds(text: str) -> list[int]:
    first, _, last = text.partition("..")
    return list(range(int(first), int(last or first) + 1))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=_seeds, default=_seeds("1..8"), help="default: 1..8")
    parser.add_argument("--minutes", type=float, default=4, help="of each round; default: 4")
    parser.add_argument("--hz", type=float, default=2, help="scans a second; default: 2")
    parser.add_argument("--json", action="store_true", help="one document on stdout")
    parser.add_argument("--maps", type=Path, default=ROOT.parent / "shared/data/maps",
                        help="folder with the Open-RMF plans; default: %(default)s")  # fmt: skip
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
