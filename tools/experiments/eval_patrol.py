"""Evaluate the patrol planner in worlds of the clinic's doors, whose schedules nobody knows.

    python tools/experiments/eval_patrol.py  8 worlds, two weeks, a shut door costs 10 s
    python tools/experiments/eval_patrol.py --seeds 0..30 --jobs 2 --keep trials.jsonl
    python tools/experiments/eval_patrol.py --wait 60 --weeks 1
    python tools/experiments/eval_patrol.py --asks
    python tools/experiments/eval_patrol.py --learning --weeks 1 what a robot learns that only looks
    python tools/experiments/eval_patrol.py --trips  expected time of trips against an oracle
    python tools/experiments/eval_patrol.py --json > scores.json

69 rooms of the recording `clinic_week`, 95 rounds a week. In a round each room is to be visited
once, by one of its doors; the robot learns only from what its own rounds meet. All planners meet
the same doors.

fixed: a short tour by each room's first door, then the other doors of the rooms that were shut.
nearest: always on to the nearest door of a room that was not visited. ours: as `patrol-plan`, by
what it has learnt so far. true: the same by the true schedule, and leaves out what is open for
less than 5 % of the time: what there is to gain. all: ours, leaving nothing out.

Failed approaches: doors that were tried and did not let the robot in. Mean time to visit: over
the reachable rooms, those with a door that lets the robot in for 90 % of the round; one that was
not visited counts as visited at the round's end.

--learning: the robot drives from door to door for --minutes a round, and only looks. Then each door
is forecast for the week after, every half hour; the Brier score is the mean squared error. By a
short tour that goes on where the last round stopped; by the same tour, each round from home; as
`patrol-plan` orders, likely open first; by the same search, longest unseen first. --learn-every
lets the order of likely doors lag behind; in the end all have learnt all that they saw.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from typing import Any

from patrol_eval.door_trips import print_trips, trips_report, trips_tried
from patrol_eval.learning import learning_report, learning_tried, print_learning
from patrol_eval.patrol_report import print_report, report
from patrol_eval.patrol_trials import TrialOptions, tried
from patrol_eval.patrol_world import RoundRules

from semmap_log.analysis.planning.door_chances import SkipRule


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the trials that are not kept yet, and print what all say."""
    options = _parsed(sys.argv[1:] if arguments is None else arguments)
    run, tell = _what(options)
    trials = sorted(_trials(options, run), key=lambda trial: trial["seed"])
    found, show = tell(trials)
    if options.json:
        print(json.dumps(found, indent=1))
    else:
        show(found)
    return 0


def _what(options: argparse.Namespace) -> tuple[Any, Any]:
    """Return what runs a seed, and what makes figures of all, with what prints them."""
    if options.trips:
        run = partial(trips_tried, learning_weeks=options.weeks)
        return run, lambda trials: (trips_report(trials), print_trips)
    if options.learning:
        run = partial(
            learning_tried,
            weeks=options.weeks,
            budget_s=60 * options.minutes,
            learn_every=options.learn_every,
        )
        return run, lambda trials: (learning_report(trials), print_learning)
    rules = RoundRules(budget_s=60 * options.budget, wait_s=options.wait, asks=options.asks)
    trial = TrialOptions(
        rules=rules,
        weeks=options.weeks,
        planners=tuple(options.planners.split(",")),
        skip=SkipRule(options.skip_below),
        estimator=options.estimator,
        learn_every=options.learn_every,
    )
    return partial(tried, options=trial), lambda trials: (report(trials), print_report)


def _trials(options: argparse.Namespace, run: Any) -> Iterator[dict[str, Any]]:
    """Yield a trial a seed: those that are kept, then the others as they end."""
    kept = _kept(options.keep)
    seeds = _seeds(options.seeds)
    yield from (kept[seed] for seed in seeds if seed in kept)
    left = [seed for seed in seeds if seed not in kept]
    begin = time.monotonic()
    with ProcessPoolExecutor(options.jobs) as pool:
        running = [pool.submit(run, seed) for seed in left]
        for number, done in enumerate(as_completed(running), start=1):
            trial = done.result()
            if options.keep is not None:
                with options.keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(trial) + "\n")
            took_s = time.monotonic() - begin
            print(f"seed {trial['seed']}: {number} of {len(left)}, {took_s:.0f} s", file=sys.stderr)
            yield trial


def _kept(path: Path | None) -> dict[int, dict[str, Any]]:
    if path is None or not path.exists():
        return {}
    trials = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {trial["seed"]: trial for trial in trials}


def _seeds(text: str) -> list[int]:
    """Return the seeds of `0..8` (8 is not among them) or `3,5`."""
    if ".." in text:
        first, _, end = text.partition("..")
        return list(range(int(first), int(end)))
    return [int(seed) for seed in text.split(",")]


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", default="0..8", help="of the worlds: 0..8, or 3,5")
    parser.add_argument("--weeks", type=int, default=2)
    parser.add_argument("--wait", type=float, default=10.0, help="at a shut door, seconds")
    parser.add_argument("--asks", action="store_true", help="unlocked doors open when asked")
    parser.add_argument("--trips", action="store_true", help="trips after --weeks of rounds")
    parser.add_argument("--learning", action="store_true", help="what --weeks of looking teach")
    parser.add_argument("--minutes", type=float, default=15.0, help="of a round that only looks")
    parser.add_argument("--budget", type=float, default=60.0, help="of a round, minutes")
    parser.add_argument("--planners", default="fixed,nearest,ours,true")
    parser.add_argument("--skip-below", type=float, default=SkipRule().below)
    parser.add_argument("--estimator", default="filter")
    parser.add_argument("--learn-every", type=int, default=1, help="so many rounds; quicker")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="a file of trials, to go on from")
    parser.add_argument("--json", action="store_true")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
