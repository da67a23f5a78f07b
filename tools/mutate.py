"""Change functions in one place at a time, and count the changes that no test notices.

    python tools/mutate.py --faults 30 --seed 7                     the rooms that safety rests on
    python tools/mutate.py --faults 600 semmap_log/store/writing    other folders or files
    python tools/mutate.py --only 3f9c02d1a7e845b6/LeaveOutCall/0   one mutant again

cosmic-ray makes the mutants: another operator, number or condition, a loop left out; and here, a
call left out. Each runs in a copy of the tree, against the quick tests nearest to its module
(`tools/tests_of.py`), with and without compiled loops, to its callers, of its room, and of what a
program uses, until one fails. Mutants that may live are in `tests/surviving_mutants.yaml`, each
with the reason. The code of a function identifies it there, so entries survive moved files and new
docstrings. The exit code is 1 if another mutant survives.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml
from mutants import Function, Mutant, chosen, functions_of
from tests_of import PACKAGE, ROOT, TESTS, modules_of, tests_of

SURVIVORS = TESTS / "surviving_mutants.yaml"
ROOMS = (
    "store", "door_log", "replay", "folds", "costmap_2d", "probabilities", "signing", "trimming",
)  # fmt: skip
COPIED = ("semmap_log", "tests", "tools", "pyproject.toml")
LINKED = ("recordings", "docs", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", ".ci")
NEAREST_FILES, MOST_CALLERS = 80, 4
TEST_TIMEOUT_S, STAGE_TIMEOUT_S = 120, 900
MEMORY_BYTES = 12 * 2**30


@dataclass(frozen=True)
class Fate:
    """What became of a mutant."""

    mutant: str
    function: str
    change: list[str]
    killer: str
    """The test that failed; empty: it survived."""
    seconds: float


class BrokenTestError(Exception):
    """A test fails without any mutant."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Try mutants; 0: all died or may live, 1: another survived."""
    args = _parsed(arguments)
    mutants = chosen(_functions(args.paths), args.faults, args.seed, args.only)
    may_live = set() if args.only else set(survivors())
    fates, alive = [], 0
    tried = [mutant for mutant in mutants if mutant.key not in may_live]
    for fate in _fates(tried, args.jobs):
        fates.append(fate)
        line = f"{len(fates)}/{len(tried)} {fate.function} ({fate.seconds:.0f} s): "
        print(line + (fate.killer or "SURVIVED"), file=sys.stderr, flush=True)
        if not fate.killer:
            alive += 1
            entry = {"mutant": fate.mutant, "function": fate.function, "change": fate.change}
            print(yaml.safe_dump([entry], sort_keys=False, width=100), file=sys.stderr, flush=True)
    if args.json:
        print(json.dumps({"seed": args.seed, "mutants": [asdict(fate) for fate in fates]}))
    else:
        print(f"seed {args.seed}: {len(mutants)} mutants, {len(fates) - alive} died, "
              f"{len(mutants) - len(tried)} may live, {alive} survived")  # fmt: skip
    if alive:
        print(f"Write a test that fails for each, or add it to {SURVIVORS.relative_to(ROOT)} with "
              "the reason why it may live.", file=sys.stderr)  # fmt: skip
    return int(alive > 0)


def survivors() -> dict[str, str]:
    """Return the reason why each listed mutant may live."""
    entries = yaml.safe_load(SURVIVORS.read_text(encoding="utf-8")) or []
    return {entry["mutant"]: entry["reason"] for entry in entries}


def _fates(mutants: Sequence[Mutant], jobs: int) -> Iterator[Fate]:
    """Yield what becomes of mutants, in processes that have imported what all tests need."""
    import hypothesis  # noqa: F401
    import numpy as np  # noqa: F401
    import pytest  # noqa: F401

    memory = Path("/dev/shm")  # noqa: S108 - a folder with a name that nobody can foresee
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        Path(folder).chmod(0o755)  # some tests become nobody, and look in
        context = multiprocessing.get_context("fork")
        with context.Pool(jobs, _enter_copy, [Path(folder)]) as pool:
            yield from pool.imap_unordered(_fate, mutants)


def _enter_copy(folder: Path) -> None:
    """Make a copy of the tree for this process, and work in it."""
    tree, temporary = folder / str(os.getpid()) / "tree", folder / str(os.getpid()) / "tmp"
    temporary.mkdir(parents=True)
    tree.mkdir()
    for name in COPIED:
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy2)(ROOT / name, tree / name)
    for name in LINKED:
        (tree / name).symlink_to(ROOT / name)
    os.chdir(tree)
    libraries = Path(sys.prefix)  # which lies in the tree itself, as README has it
    others = [
        each
        for each in sys.path
        if each and (Path(each).is_relative_to(libraries) or not Path(each).is_relative_to(ROOT))
    ]
    sys.path[:] = [str(tree), *others]
    sys.dont_write_bytecode = True
    os.environ.update(PYTHONPATH=os.pathsep.join(sys.path), PYTHONDONTWRITEBYTECODE="1",
                      TMPDIR=str(temporary), PYTEST_DEBUG_TEMPROOT=str(temporary))  # fmt: skip


def _fate(mutant: Mutant) -> Fate:
    start, function = time.monotonic(), mutant.function
    path = function.path.relative_to(ROOT)
    original = path.read_bytes()
    path.write_text(function.before + mutant.text() + function.after, encoding="utf-8")
    killer, environment, tests = "", {}, []
    try:
        for tests, environment in _stages(function):
            if killer := _failed(tests, environment):
                break
    finally:
        path.write_bytes(original)
    again = [killer] if killer.startswith("tests") else tests
    if killer and (broken := _failed(again, environment)):
        raise BrokenTestError(broken)
    name = ".".join((*path.with_suffix("").parts, function.name))
    return Fate(mutant.key, name, mutant.change(), killer, round(time.monotonic() - start, 1))


def _stages(function: Function) -> Iterator[tuple[list[str], dict[str, str]]]:
    """Yield which tests run, and in which environment: of its module, callers, room, and users."""
    path = function.path.relative_to(ROOT)
    folder = Path("tests").joinpath(*path.parts[1:-1])
    tests = [each.relative_to(ROOT) for each in tests_of(function.path)]
    tests.sort(key=lambda test: (test.stem != f"test_{path.stem}", test.parent != folder))
    nearest = [str(test) for test in tests[:NEAREST_FILES]]
    yield nearest, {}
    if re.search(r"semmap_log\.\S*loops", path.read_text(encoding="utf-8")):
        yield nearest, {"SEMMAP_LOG_PLAIN": "1"}
    done = {*nearest}
    if of_callers := [test for test in _tests_of_callers(function) if test not in done]:
        yield of_callers, {}
        done.update(of_callers)
    room = next(each for each in (folder, *folder.parents) if each.is_dir())
    if room.name != "tests":
        yield [str(room), *(f"--ignore={test}" for test in sorted(done))], {}
    users = [
        each for each in Path("tests").glob("test_*.py") if "semmap_log as" in each.read_text()
    ]
    yield sorted({*map(str, users)} - done), {}


def _tests_of_callers(function: Function) -> list[str]:
    """Return the nearest tests of the few modules that also contain a function's name."""
    *classes, name = function.name.split(".")
    word = re.compile(rf"\b{classes[-1] if classes and name.startswith('_') else name}\b")
    callers = [path for path in modules_of(PACKAGE) if word.search(path.read_text("utf-8"))]
    callers = [path for path in callers if path != function.path]
    if len(callers) > MOST_CALLERS:  # a common word
        return []
    nearest = [test for path in callers for test in tests_of(path)[:2]]
    return list(dict.fromkeys(str(test.relative_to(ROOT)) for test in nearest))


def _failed(arguments: list[str], environment: dict[str, str]) -> str:
    """Return the first test that fails, or how its process ended; empty: all pass."""
    reading, writing = os.pipe()
    if (child := os.fork()) == 0:
        _run_tests(arguments, writing, environment)
    os.close(writing)
    end = time.monotonic() + STAGE_TIMEOUT_S
    while (status := os.waitpid(child, os.WNOHANG)) == (0, 0) and time.monotonic() < end:
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # what its tests left running, or itself
    with os.fdopen(reading) as pipe:
        failed = pipe.read()
    code = os.waitstatus_to_exitcode((status if status[0] else os.waitpid(child, 0))[1])
    return "" if code in {0, 5} else failed or f"exit code {code}"  # 5: no test to run


def _run_tests(arguments: list[str], output: int, environment: dict[str, str]) -> None:
    """Run tests and end this process."""
    import pytest

    class Reporter:
        def pytest_runtest_logreport(self, report: Any) -> None:
            if report.failed:
                os.write(output, report.nodeid.encode())

        pytest_collectreport = pytest_runtest_logreport

    code = 3
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        os.environ.update(environment)
        for standard in range(3):
            os.dup2(os.open(os.devnull, os.O_RDWR), standard)
        options = (
            f"-x -q --tb=no -p no:cacheprovider --timeout={TEST_TIMEOUT_S} --hypothesis-seed=1"
        )
        code = pytest.main([*options.split(), *arguments], plugins=[Reporter()])
    finally:
        os._exit(code)


def _functions(paths: Sequence[str]) -> list[Function]:
    """Return the functions of folders and files; of the rooms, wherever they are."""
    roots = [Path(path).resolve() for path in paths]
    for room in () if paths else ROOMS:
        found = [folder for folder in PACKAGE.rglob(room) if folder.is_dir()]
        roots += found or sys.exit(f"{PACKAGE}: expected a folder {room}, found none; see ROOMS")
    files = {path for root in roots for path in ([root] if root.is_file() else root.rglob("*.py"))}
    return [each for path in sorted(files) for each in functions_of(path)]


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Count changes that no test notices.")
    parser.add_argument("paths", nargs="*", help=f"folders, files; default: {' '.join(ROOMS)}")
    parser.add_argument("--faults", type=int, default=30, metavar="N", help="default: 30 mutants")
    parser.add_argument("--seed", type=int, default=7, help="which of all; default: 7")
    parser.add_argument("--only", metavar="MUTANT", help="one, as the list of survivors names it")
    parser.add_argument("--jobs", type=int, default=2, help="mutants at a time; default: 2")
    parser.add_argument("--json", action="store_true", help="print what became of each as JSON")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BrokenTestError as error:
        sys.exit(f"{error} fails without any mutant: make it pass first")
