"""Do to logs what time does to robots, and look for every event that was acknowledged.

    python tools/faults.py                              every kind, a few minutes
    python tools/faults.py disk power                   these kinds
    python tools/faults.py disk --faults 300 --seed 7   a sample, the same one each time
    python tools/faults.py --seconds 600                as much as ten minutes hold, of every kind

Each kind runs in a process of its own, and is stopped in the midst of a fault when its time is
over. How far it is stands on stderr, and a line for each kind that has ended.

The exit code is 1 if an acknowledged event was lost, one was invented, or a promise was broken;
then the table says what was done, and where the log is kept as the fault left it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

from fault_injection.apart import Budget, KindApart, Share
from fault_injection.fault import CannotTryError, Kind, Plan
from fault_injection.kinds import KINDS
from fault_injection.report import LINE_EVERY_S, Line, Tally, show, to_json

MEMORY = Path("/dev/shm")  # noqa: S108 - folders of our own, with names nobody can foresee
INTERRUPTED = 130


def main(
    arguments: Sequence[str] | None = None, clock: Callable[[], float] = time.monotonic
) -> int:
    """Try what the command line asks for; 0 good, 1 something was lost, invented or broken.

    Args:
        arguments: Of the command line.
        clock: Tells seconds.
    """
    args = _parsed(sys.argv[1:] if arguments is None else arguments)
    names = list(dict.fromkeys(name for asked in args.kinds for name in _named(asked)))
    budget = Budget(clock, args.seconds, len(names))
    tallies: list[Tally] = []
    code = 0
    try:
        for name in names:
            tallies.append(Tally(name))
            _try_kind(KINDS[name], args, tallies[-1], budget)
    except KeyboardInterrupt:
        code = INTERRUPTED
    if args.json:
        print(json.dumps(to_json(tallies, args.seed), indent=2))
    else:
        show(tallies, args.seed)
    return 1 if any(tally.bad for tally in tallies) else code


def _try_kind(kind: Kind, args: argparse.Namespace, tally: Tally, budget: Budget) -> None:
    """Count what a kind yields, until it ends, or its time or number is over."""
    share = budget.next_share()
    if share.is_over(share.start):
        tally.skipped = "the time of --seconds was over"
        return
    line = Line(tally, share.start)
    with tempfile.TemporaryDirectory(
        dir=args.dir, prefix="faults_", ignore_cleanup_errors=True
    ) as folder:
        plan = Plan(args.seed, Path(folder), faults=args.faults, keep=args.keep, only=args.only)
        try:
            with closing(KindApart(kind, plan)) as at_work:
                _count_outcomes(at_work, tally, share, line)
        except CannotTryError as error:
            tally.skipped = str(error)
        finally:
            tally.seconds = budget.clock() - share.start
            line.end()


def _count_outcomes(at_work: KindApart, tally: Tally, share: Share, line: Line) -> None:
    now = share.start
    while not share.is_over(now):
        try:
            outcome = at_work.next(min(share.left(now), LINE_EVERY_S))
        except StopIteration:
            return
        if outcome is not None:
            tally.count(outcome)
        now = share.clock()
        tally.seconds = now - share.start
        line.show(now)
    if not tally.faults:
        tally.skipped = "the time of --seconds was over before its first fault"


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description="Try faults on logs; print what was lost: nothing, or how to see it again."
    )
    parser.add_argument("kinds", nargs="*", type=_kind, metavar="KIND", default=["all"],
                        help=f"of {', '.join(KINDS)}; default: all")  # fmt: skip
    parser.add_argument(
        "--seed", type=int, default=1, help="what is drawn comes from it; default: 1"
    )
    parser.add_argument("--faults", type=_count, metavar="N",
                        help="a sample of so many of each kind; default: all of them")  # fmt: skip
    parser.add_argument("--only", type=int, metavar="N",
                        help="the fault of that number alone, as the table names it")  # fmt: skip
    parser.add_argument("--seconds", type=float, metavar="S",
                        help="end after so long; each kind to come gets its share")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="one document instead of the table")
    parser.add_argument("--keep", type=Path, default=Path("faults_found"), metavar="DIR",
                        help="where to keep logs on which something went wrong; default: "
                        "faults_found")  # fmt: skip
    parser.add_argument("--dir", type=Path, default=MEMORY if os.access(MEMORY, os.W_OK) else None,
                        metavar="DIR", help="where to work; default: in memory")  # fmt: skip
    return parser.parse_args(arguments)


def _kind(text: str) -> str:
    if not _named(text):
        raise argparse.ArgumentTypeError(f"no kind {text}; there are: all, {', '.join(KINDS)}")
    return text


def _named(asked: str) -> list[str]:
    """Return the kinds of that name: all, one, or those that begin with it (`power`)."""
    return [name for name in KINDS if asked in {"all", name} or name.startswith(f"{asked}-")]


def _count(text: str) -> int:
    value = int(text.replace("_", ""))
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a number from 1 on, got {text}")
    return value


if __name__ == "__main__":
    sys.exit(main())
