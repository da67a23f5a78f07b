"""A program that asks a log everything, many times over; what it is told goes to stdout as JSON.

    python -m tests.store.asking LOG WHOLE [--wait [--refresh]] [--rounds N] [--fallback ask|look]

Run as a process of its own: a signal that ends it is seen. With --wait it opens the log once, says
so, and waits for a line before it asks, with --refresh after each time a look at what is new; else
each question opens the log anew. WHOLE is a copy that nobody damages: it says what there is to ask.
"""

from __future__ import annotations

import argparse
import ctypes
import errno
import json
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import semmap_log as sl

Question = Callable[[sl.DoorLog], Any]


def questions(log: sl.DoorLog) -> dict[str, Question]:
    """Return what to ask, by names that stay the same for a copy of the log."""
    commits = list(log.commits())
    moments = [commit.recorded_ns for commit in commits[:: max(1, len(commits) // 5)]]
    numbers = [commit.last_event for commit in commits[:: max(1, len(commits) // 5)]]
    return {
        "now": lambda log: log.replay(),
        "commits": lambda log: list(log.commits()),
        "history": lambda log: list(log.history()),
        "batches": lambda log: [list(batch) for batch in log.batches()],
        "summary": lambda log: log.summary().events,
        **{f"at {ns}": lambda log, ns=ns: log.replay(at=ns) for ns in moments},
        **{f"known at {ns}": lambda log, ns=ns: log.replay(known_at=ns) for ns in moments},
        **{f"event {number}": lambda log, number=number: log.entry(number) for number in numbers},
    }


def told(ask: Question, log: Callable[[], sl.DoorLog]) -> tuple[str, str]:
    """Return an answer, or our error, as text."""
    try:
        return "answer", repr(ask(log()))
    except sl.SemmapError as error:
        return "error", str(error)


def _force_fallback(how: str) -> None:
    """Forbid the call that copies; with `look` also the one that asks for pages."""
    from semmap_log.store.reading import mapped_file

    library = mapped_file._library()

    def refused(*_: object) -> int:
        ctypes.set_errno(errno.ENOSYS)
        return -1

    library.process_vm_readv = refused
    if how == "look":
        madvise = library.madvise

        def unknown(address: int, size: int, advice: int) -> int:
            if advice != mapped_file._MADV_POPULATE_READ:
                return int(madvise(address, size, advice))
            ctypes.set_errno(errno.EINVAL)
            return -1

        library.madvise = unknown


def main() -> None:
    """Ask."""
    parser = argparse.ArgumentParser()
    parser.add_argument("log", type=Path)
    parser.add_argument("whole", type=Path)
    parser.add_argument("--wait", action="store_true")
    parser.add_argument("--refresh", action="store_true")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--fallback", choices=["ask", "look"])
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    asked = questions(sl.read(args.whole))
    if args.fallback:
        _force_fallback(args.fallback)
    if args.wait:
        log = sl.read(args.log)
        sys.stdout.write("open\n")
        sys.stdout.flush()
        sys.stdin.readline()

    def opened() -> sl.DoorLog:
        if not args.wait:
            return sl.read(args.log)
        if args.refresh:
            log.refresh()
        return log

    found = []
    for _ in range(args.rounds):
        for name, ask in asked.items():
            found.append((name, *told(ask, opened)))
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main()
