"""Prove that the tests would notice: take out one guard at a time, and see which test fails.

    python tools/mutations.py                 every guard: some minutes
    python tools/mutations.py sync lock       those whose name has one of these words
    python tools/mutations.py --sample 40     so many of them, others at each run
    python tools/mutations.py --check         only whether each guard is still where the list says

The guards are in `tools/mutation/`; how one is told, `mutation/mutant.py` says. Each mutant is a
copy of the tree with one piece replaced; the tests that are named for it run until the first
fails. Before that they must all pass with every guard in its place. The exit code is 1 if they do
not, if a mutant survives, or if a guard or a test is not found, or found twice.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from mutation.guards import GUARDS
from mutation.mutant import Checkout, Mutant

ROOT = Path(__file__).resolve().parent.parent
COPIED = ("semmap_log", "tests", "tools", "pyproject.toml")
LINKED = ("recordings", "docs")
"""What tests read, and nothing writes."""
TIMEOUT_S = 900
MEMORY = Path("/dev/shm")  # noqa: S108 - folders of our own, with names nobody can foresee


@dataclass(frozen=True, slots=True)
class Fate:
    """What became of a mutant."""

    mutant: Mutant
    killer: str
    """The test that failed, or why it is said to be dead; empty: it survived."""
    seconds: float
    is_broken: bool = False
    """The tests could not even be run."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for; 0 all mutants died, 1 one survived, or is out of date."""
    args = _parsed(sys.argv[1:] if arguments is None else arguments)
    chosen = [m for m in GUARDS if not args.words or any(w in m.name for w in args.words)]
    if args.sample is not None:
        chosen = random.sample(chosen, min(args.sample, len(chosen)))
    here = Checkout(ROOT)
    problems = [problem for mutant in chosen if (problem := mutant.problem(here))]
    for problem in problems:
        print(problem, file=sys.stderr)
    if problems or args.check:
        return int(bool(problems))
    if not args.only_mutants and (problem := _problem_without_mutation(chosen)):
        print(f"with every guard in its place: {problem}", file=sys.stderr)
        return 1
    with ThreadPoolExecutor(args.jobs) as pool:
        fates = []
        for fate in pool.map(fate_of, chosen):
            print(_line(fate), flush=True)
            fates.append(fate)
    alive = [fate for fate in fates if not fate.killer or fate.is_broken]
    print(f"{len(fates)} guards taken out one at a time: {len(fates) - len(alive)} noticed, "
          f"{len(alive)} not")  # fmt: skip
    return int(bool(alive))


def _problem_without_mutation(mutants: Sequence[Mutant]) -> str:
    """Return which test fails though nothing is missing; empty: none."""
    tests = dict.fromkeys(test for mutant in mutants for test in mutant.tests)
    return fate_of(Mutant("nothing", "", "", "", tuple(tests))).killer


def fate_of(mutant: Mutant) -> Fate:
    """Make a mutant in a folder of its own, run its tests, and say which of them noticed."""
    start = time.monotonic()
    with tempfile.TemporaryDirectory(
        prefix="mutant_", dir=MEMORY if MEMORY.is_dir() else None
    ) as folder:
        tree, temporary = Path(folder) / "tree", Path(folder) / "tmp"
        Path(folder).chmod(0o755)  # some tests become nobody, and look in
        temporary.mkdir()
        tree.mkdir()
        for name in COPIED:
            _copy(ROOT / name, tree / name)
        for name in LINKED:
            (tree / name).symlink_to(ROOT / name)
        copied = Checkout(tree)
        if mutant.where:
            mutant.apply(copied)
        tests = map(copied.test_id, mutant.tests)
        command = [sys.executable, "-m", "pytest", "--all", "-x", "-q", "--tb=no", "--no-header",
                   "-p", "no:cacheprovider", *tests]  # fmt: skip
        environment = {**os.environ, "PYTHONPATH": str(tree), "TMPDIR": str(temporary),
                       "PYTHONDONTWRITEBYTECODE": "1",
                       "SEMMAP_LOG_PLAIN": "1"}  # fmt: skip
        # What numpy does is mutated; tests of the compiled loops turn these on.
        try:
            done = subprocess.run(command, cwd=tree, env=environment, capture_output=True,
                                  text=True, check=False, timeout=TIMEOUT_S)  # fmt: skip
        except subprocess.TimeoutExpired:
            return Fate(mutant, f"no end after {TIMEOUT_S} s", time.monotonic() - start)
    seconds = time.monotonic() - start
    if done.returncode == 0:
        return Fate(mutant, "", seconds)
    failed = re.search(r"^FAILED (\S+)|/(tests/\S+: KeyboardInterrupt)", done.stdout, re.MULTILINE)
    if failed:
        return Fate(mutant, (failed[1] or failed[2]).removeprefix("tests/"), seconds)
    return Fate(mutant, done.stdout[-300:] + done.stderr[-300:], seconds, is_broken=True)


def _copy(source: Path, target: Path) -> None:
    if source.is_dir():
        shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
    else:
        shutil.copy2(source, target)


def _line(fate: Fate) -> str:
    killer = fate.killer or "SURVIVED"
    if fate.is_broken:
        killer = f"BROKEN: {fate.killer}"
    return f"{fate.mutant.name:<58} {killer}  ({fate.seconds:.0f} s)"


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Take out guards and see which test notices.")
    parser.add_argument("words", nargs="*", help="only guards whose name has one of these words")
    parser.add_argument("--check", action="store_true", help="only look the guards up")
    parser.add_argument("--sample", type=int, metavar="N", help="only N of them, by chance")
    parser.add_argument("--only-mutants", action="store_true",
                        help="trust that the tests pass with every guard in its place")  # fmt: skip
    parser.add_argument("--jobs", type=int, default=2, help="mutants at a time; default: 2")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
