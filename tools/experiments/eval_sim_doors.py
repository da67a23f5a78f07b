"""Hold intervals, waits and best hours against doors whose chances are known exactly.

    python tools/experiments/eval_sim_doors.py
    python tools/experiments/eval_sim_doors.py --only wait --weeks 6 --seeds 20
    python tools/experiments/eval_sim_doors.py --json > sim_doors.json

Each door is a two-state chain whose rates hold for half an hour of the week: `door_sim`. So P(open)
at any time, by what was known at another, and the mean wait are not estimated, but solved. A seed
is a door of its own. Each is known all through, and, another time, only seen by a patrol each half
hour, whose sensor is right 90 % of the time.

intervals: how often the 90 % interval holds P(open), at 28 times of the week that comes. `count`
tells the share of all hours, `schedule` what each hour tends to, `filter` 1, 6 and 24 hours ahead
of what is known. Doors without hours that forget in 15 minutes to 48 hours, and six kinds with
hours.

wait: the expected wait until open, at 20 times of the week that comes, against the mean wait of the
chain: the ratio of their means over these times, door by door. "by true rates": how many were
within a quarter, had those and what `filter` believes of the state at those times been all.

best: P(open) in the hour that `best-time` names first, against that of the truly best hour.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any

import numpy as np
from door_sim.kinds import KINDS, RELAXATIONS_H, without_hours
from door_sim.told import DOOR, evidence_of
from door_sim.week_chain import MONDAY_NS, WeekChain
from numpy.typing import NDArray
from patrol_sim.habits import HOUR_NS

from semmap_log.analysis.beliefs.best_times import best_runs
from semmap_log.analysis.beliefs.protocol import Patrol
from semmap_log.analysis.beliefs.trials import StateIntervals
from semmap_log.analysis.probabilities.belief_fold import by_name
from semmap_log.analysis.probabilities.estimator import StateModel
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import LEAST, MOST
from semmap_log.core.model.local_clock import LocalClock

CLOCK = LocalClock("UTC")
WEEK_NS = 7 * 24 * HOUR_NS
AHEAD_H = (1, 6, 24)
TIMES, ASKED = 28, 20
WITHIN = (0.25, 0.10)

Row = dict[str, Any]


@dataclass(frozen=True)
class Told:
    """A simulated door, and what is known of it."""

    chain: WeekChain
    life: StateIntervals
    known: DoorEvidence
    """To the end of the week that comes."""
    now_ns: int
    rng: np.random.Generator

    def times(self, count: int) -> NDArray[np.int64]:
        """Return times of the week that comes, ascending."""
        return np.sort(self.now_ns + (self.rng.random(count) * WEEK_NS).astype(np.int64))

    def is_open(self, times_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return how it really stood."""
        return self.life.is_open[np.searchsorted(self.life.start_ns, times_ns, "right") - 1]

    def p_open(
        self, times_ns: NDArray[np.int64], known_ns: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Return P(open) by what was known at another time."""
        if len(self.known.seen_ns):
            known = self.chain.p_open_by(self.known.seen_ns, self.known.llr, known_ns)
            return self.chain.p_open_later(times_ns, known_ns, known)
        return self.chain.p_open_later(times_ns, known_ns, self.is_open(known_ns))


def main() -> int:
    options = _options()
    rows = list(_rows(options))
    if options.json:
        print(json.dumps(rows, indent=2))
        return 0
    print(
        f"{datetime.now(timezone.utc):%Y-%m-%d}, seeds {options.range[0]}..{options.range[-1]}, by:"
    )
    print(f"`{shlex.join(['python', 'tools/experiments/eval_sim_doors.py', *sys.argv[1:]])}`\n")
    for question in options.only:
        asked = [row for row in rows if row["question"] == question]
        names = [name for name in asked[0] if name != "question"]
        print(f"| {' | '.join([question, *names[1:]])} |\n|{'---|' * len(names)}")
        for row in asked:
            print(f"| {' | '.join(_cell(row[name]) for name in names)} |")
        print()
    return 0


def _rows(options: argparse.Namespace) -> Iterator[Row]:
    for question in options.only:
        for kind, make in _kinds(question).items():
            for weeks in options.weeks:
                for patrolled in (False, True):
                    seen = "patrol" if patrolled else "known"
                    row: Row = {"question": question, "door": kind, "weeks": weeks, "seen": seen}
                    doors = (told(make, weeks, seed, patrolled=patrolled)
                             for seed in options.range)  # fmt: skip
                    row |= QUESTIONS[question](doors)
                    print(f"{question}: {kind}, {weeks} weeks, {seen}", file=sys.stderr)
                    yield row


def told(
    make: Callable[[np.random.Generator], WeekChain], weeks: int, seed: int, *, patrolled: bool
) -> Told:
    """Return a door of a kind, after so many weeks."""
    rng = np.random.default_rng([seed, weeks])
    chain = make(rng)
    life = chain.life(rng, weeks + 1)
    now_ns = MONDAY_NS + weeks * WEEK_NS
    patrol = Patrol(HOUR_NS // 2, 0.9, seed) if patrolled else None
    return Told(chain, life, evidence_of(life, now_ns + WEEK_NS, patrol), now_ns, rng)


def intervals(doors: Iterator[Told]) -> Row:
    """Return how often each estimator's 90 % interval holds the truth."""
    held: dict[str, list[float]] = {}
    for door in doors:
        past = door.known.up_to(door.now_ns - 1)
        times = door.times(TIMES)
        now = np.full(TIMES, door.now_ns - 1)
        hours = door.now_ns + np.arange(7 * 48) * HOUR_NS // 2
        all_hours = np.full(TIMES, door.chain.p_open(hours).mean())
        for name, truth in (("count", all_hours), ("schedule", door.chain.p_open(times))):
            said = by_name(name).learn({DOOR: past}, CLOCK).predict(DOOR, times, now)
            held.setdefault(name, []).append(_held(said.low, said.high, truth))
        learnt = by_name("filter").learn({DOOR: door.known}, CLOCK)
        for ahead_h in AHEAD_H:
            then = times[times + ahead_h * HOUR_NS < door.now_ns + WEEK_NS]
            said = learnt.predict(DOOR, then + ahead_h * HOUR_NS, then)
            truth = door.p_open(then + ahead_h * HOUR_NS, then)
            held.setdefault(f"filter {ahead_h} h", []).append(_held(said.low, said.high, truth))
    return {name: round(float(np.mean(each)), 3) for name, each in held.items()}


def wait(doors: Iterator[Told]) -> Row:
    """Return how near the waits that are said come to those that are."""
    ratios, by_rates, inside = [], [], []
    for door in doors:
        learnt = by_name("filter").learn({DOOR: door.known}, CLOCK)
        assert isinstance(learnt, StateModel)
        times = door.times(ASKED)
        said = np.mean([learnt.wait_s(DOOR, time) / 3600 for time in times.tolist()])
        ends = [learnt.wait_interval_s(DOOR, time) for time in times.tolist()]
        low, high = np.mean(ends, axis=0) / 3600
        was = door.chain.wait_h(times, door.is_open(times)).mean()
        if was > 0:
            closed = np.zeros(ASKED, np.bool_)
            shut = 1 - learnt.predict(DOOR, times, times).p_open
            by_rates.append((shut * door.chain.wait_h(times, closed)).mean() / was)
            ratios.append(said / was)
            inside.append(low <= was <= high)
    near, nearer = (np.abs(np.array(each) - 1) for each in (ratios, by_rates))
    found = {f"within {share:.0%}": float(np.mean(near <= share)) for share in WITHIN}
    median = float(np.median(ratios))
    return {
        "said / was": round(median, 2),
        **found,
        "in interval": round(float(np.mean(inside)), 2),
        "by true rates": float(np.mean(nearer <= WITHIN[0])),
    }


def best(doors: Iterator[Told]) -> Row:
    """Return how much P(open) is lost by going when `best-time` says."""
    lost, right = [], []
    for door in doors:
        past = door.known.up_to(door.now_ns - 1)
        middles = door.now_ns + np.arange(7 * 24) * HOUR_NS + HOUR_NS // 2
        learnt = by_name("schedule").learn({DOOR: past}, CLOCK)
        said = learnt.predict(DOOR, middles, np.full(len(middles), door.now_ns - 1))
        run = best_runs(said.p_open, np.ones(len(middles), np.bool_), 1)[0]
        truth = door.chain.p_open(middles)
        lost.append(float(truth.max() - truth[run].mean()))
        right.append(lost[-1] <= 0.25 * truth.max())
    return {"lost, mean": round(float(np.mean(lost)), 3), "lost, most": round(max(lost), 3),
            "right": round(float(np.mean(right)), 2)}  # fmt: skip


QUESTIONS: Mapping[str, Callable[[Iterator[Told]], Row]] = {
    "intervals": intervals, "wait": wait, "best": best,
}  # fmt: skip


def _kinds(question: str) -> Mapping[str, Callable[[np.random.Generator], WeekChain]]:
    if question != "intervals":
        return KINDS
    plain = {
        f"forgets in {hours:g} h": lambda rng, hours=hours: without_hours(rng, hours)
        for hours in RELAXATIONS_H
    }
    return {**plain, **KINDS}


def _held(low: NDArray[np.float64], high: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    truth = np.clip(truth, LEAST, MOST)
    return float(((low <= truth) & (truth <= high)).mean())


def _cell(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=[*QUESTIONS], action="append", help="repeatable")
    parser.add_argument(
        "--weeks", type=int, action="append", help="of evidence; repeatable; 2, 6 and 12"
    )
    parser.add_argument("--seeds", type=int, default=24, help="doors of each kind; 24")
    parser.add_argument("--first-seed", type=int, default=0, help="other doors; 0")
    parser.add_argument("--json", action="store_true", help="one document instead of tables")
    options = parser.parse_args()
    options.only = options.only or [*QUESTIONS]
    options.weeks = options.weeks or [2, 6, 12]
    options.range = range(options.first_seed, options.first_seed + options.seeds)
    return options


if __name__ == "__main__":
    sys.exit(main())
