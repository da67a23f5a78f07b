"""Do to logs what time does to robots, and look for every event that was acknowledged.

    python tools/faults.py                              every kind, a few minutes
    python tools/faults.py disk power                   these kinds
    python tools/faults.py disk --faults 300 --seed 7   a sample, the same one each time

How far a kind has come is printed on stderr, and a line for each kind that has ended.

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
import traceback
from collections.abc import Sequence
from contextlib import closing
from itertools import islice
from pathlib import Path

from fault_injection.fault import CannotTryError, Kind, Outcome, Plan
from fault_injection.kinds import KINDS
from fault_injection.report import Line, Tally, show, to_json

MEMORY = Path("/dev/shm")  # noqa: S108 - folders of our own, with names nobody can foresee
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Try what the command line asks for; 0 good, 1 something was lost, invented or broken."""
    args = _parsed(sys.argv[1:] if arguments is None else arguments)
    names = list(dict.fromkeys(name for asked in args.kinds for name in _named(asked)))
    tallies: list[Tally] = []
    code = 0
    try:
        for name in names:
            tallies.append(Tally(name))
            _try_kind(KINDS[name], args, tallies[-1])
    except KeyboardInterrupt:
        code = INTERRUPTED
    if args.json:
        print(json.dumps(to_json(tallies, args.seed), indent=2))
    else:
        show(tallies, args.seed)
    return 1 if any(tally.bad for tally in tallies) else code


def _try_kind(kind: Kind, args: argparse.Namespace, tally: Tally) -> None:
    """Count what a kind yields, until it ends, or its number is reached."""
    start = time.monotonic()
    line = Line(tally, start)
    with tempfile.TemporaryDirectory(
        dir=args.dir, prefix="faults_", ignore_cleanup_errors=True
    ) as folder:
        plan = Plan(args.seed, Path(folder), faults=args.faults, keep=args.keep, only=args.only)
        try:
            with closing(kind(plan)) as outcomes:
                for outcome in islice(outcomes, args.faults):
                    tally.count(outcome)
                    now = time.monotonic()
                    tally.seconds = now - start
                    line.show(now)
        except CannotTryError as error:
            tally.skipped = str(error)
        except Exception:  # noqa: BLE001 - the other kinds are tried all the same
            tally.count(Outcome("the kind itself", problem=traceback.format_exc()))
        finally:
            tally.seconds = time.monotonic() - start
            line.end()


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
