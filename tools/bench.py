"""Measure what we promise beside what others reach: one table, from one run.

    python tools/bench.py                                   all of it, about seven minutes
    python tools/bench.py --only append,fold                a part
    python tools/bench.py --events 10000 10000000 --json    other sizes, for machines

The exit code is 1 if an answer was wrong or a peer failed: never because of a time. Peers that are
not installed only say so; `pip install semmap-log[bench]` has them all.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from threading import Event
from types import FrameType

from benchmark.appending import append_cases
from benchmark.belief_cases import belief_cases
from benchmark.case import Case
from benchmark.costmap_cases import costmap_cases
from benchmark.fleet_cases import fleet_cases
from benchmark.folding import SMALL, fold_cases, now_cases
from benchmark.importing import import_cases
from benchmark.logs import Workshop
from benchmark.moments import moment_cases
from benchmark.opening import crash_case, open_cases, start_cases
from benchmark.questions import day_cases, history_cases, index_cases
from benchmark.report import Result
from benchmark.sql_cases import sql_cases
from benchmark.store_cases import store_cases
from benchmark.trimming_cases import trimming_cases
from benchmark.view_cases import view_cases
from benchmark.worker import PeerFailedError, measure

ROOT = Path(__file__).resolve().parent.parent
INTERRUPTED = 130
SIZES = (10_000, 100_000)
SIZED = {
    "fold": fold_cases, "now": now_cases, "moment": moment_cases, "history": history_cases,
    "index": index_cases, "sql": sql_cases, "day": day_cases, "open": open_cases,
    "import": import_cases, "store": store_cases, "care": trimming_cases,
}  # fmt: skip
"""Group -> its cases, for each size."""
UNSIZED = {"fleet": fleet_cases, "costmap": costmap_cases, "view": view_cases}
GROUPS = ("append", *SIZED, *UNSIZED, "beliefs", "start")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what the command line asks for; 0 good, 1 a wrong answer or an error."""
    given = sys.argv[1:] if arguments is None else arguments
    args = _parsed(given)
    for number in (signal.SIGINT, signal.SIGTERM):  # the folder is removed
        signal.signal(number, _interrupted)
    try:
        with tempfile.TemporaryDirectory(dir=args.dir, prefix=".bench_") as name:
            return _run(args, Workshop(Path(name), _teller()), given)
    except (PeerFailedError, OSError, ModuleNotFoundError) as error:
        print(f"bench: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return INTERRUPTED


def _run(args: argparse.Namespace, shop: Workshop, given: Sequence[str]) -> int:
    from benchmark.report import file_system, machine_of, show, to_json

    if file_system(shop.folder) in ("tmpfs", "ramfs"):
        print("bench: this folder is in memory: a sync costs nothing here, and the figures for "
              "append and for what is cold mean nothing; choose another with --dir",
              file=sys.stderr)  # fmt: skip
    machine = machine_of(given, shop.folder)
    results: list[Result] = []
    for case in _cases(args, shop):
        if _stopped.is_set():
            raise KeyboardInterrupt
        shop.say(f"measuring {case.title}")
        results.append((case, measure(case)))
    shop.say("")
    document = to_json(results, {**machine, "disk_bytes": shop.most_bytes})
    if args.json:
        print(json.dumps(document, indent=2, ensure_ascii=False))
    else:
        show(results, document)
    return _judged(results)


def _judged(results: Sequence[Result]) -> int:
    wrong = [f"{case.title}: {measured.peer.name}" for case, peers in results
             for measured in peers if not (measured.agrees or measured.problem)]  # fmt: skip
    for line in wrong:
        print(f"bench: a wrong answer: {line}", file=sys.stderr)
    return 1 if wrong else 0


def _cases(args: argparse.Namespace, shop: Workshop) -> Iterator[Case]:
    if "append" in args.only:
        yield from append_cases(shop, args.rounds)
    for count in args.events:
        for group, cases in SIZED.items():
            if group in args.only:
                yield from cases(shop, count, args.rounds)
        shop.clear()
    tries_out = max(args.events) < SMALL
    if "open" in args.only:
        yield crash_case(shop, args.rounds, tries_out=tries_out)
    for name, unsized in UNSIZED.items():
        if name in args.only:
            yield from unsized(shop, args.rounds, tries_out=tries_out)
    if "beliefs" in args.only:
        yield from belief_cases(args.rounds, tries_out=tries_out)
    if "start" in args.only:
        yield from start_cases(args.rounds)
    shop.look()


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description="Measure semmap-log beside its peers; print one table."
    )
    parser.add_argument(
        "--events",
        type=_count,
        nargs="+",
        default=SIZES,
        metavar="N",
        help="sizes of the logs to read and to import, such as 10_000 10_000_000; default: "
        f"{' '.join(map(str, SIZES))}. Ten million take about ten minutes and 6 GB",
    )
    parser.add_argument(
        "--only",
        type=_groups,
        default=GROUPS,
        metavar="GROUP,…",
        help=f"of {', '.join(GROUPS)}; default: all",
    )
    parser.add_argument("--rounds", type=_count, metavar="N",
                        help="rounds that count; default: 20 of ten commits for append, 10 for "
                        "start, 5 for reading, 3 for import")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="one document instead of the table")
    parser.add_argument("--dir", type=Path, default=ROOT, metavar="DIR",
                        help="where to put the temporary folder: a real disk; default: the "
                        "checkout")  # fmt: skip
    return parser.parse_args(arguments)


def _count(text: str) -> int:
    value = int(text.replace("_", ""))
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a number from 1 on, got {text}")
    return value


def _groups(text: str) -> tuple[str, ...]:
    chosen = tuple(text.split(","))
    strangers = [name for name in chosen if name not in GROUPS]
    if strangers:
        raise argparse.ArgumentTypeError(
            f"no group {', '.join(strangers)}; there are: {', '.join(GROUPS)}"
        )
    return chosen


def _teller() -> Callable[[str], None]:
    """Return what shows what is going on, in place of what was, if somebody is looking."""
    start = time.monotonic()

    def say(text: str) -> None:
        if sys.stderr.isatty():
            minutes, seconds = divmod(int(time.monotonic() - start), 60)
            line = f"{minutes}:{seconds:02}  {text}" if text else ""
            print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)

    return say


_stopped = Event()
"""Somebody wants it to end. An interrupt alone would be lost where Python drops what is raised: in
callbacks."""


def _interrupted(_number: int, _frame: FrameType | None) -> None:
    _stopped.set()
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
