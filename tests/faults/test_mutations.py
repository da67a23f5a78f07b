"""The list of guards that `tools/mutations.py` takes out is up to date; what it does is long."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from mutation.guards import GUARDS
from mutation.mutant import Checkout, Mutant, guard

ROOT = Path(__file__).parents[2]

MODULE = '''
"""What guards are looked for in."""

MOST, LEAST = 300 * 2, 5


class Folder:
    """One of two that has `open`."""

    most: int = 7

    def open(self, path, *, sync=True):
        if (
            path  # which may be empty
            and self.most
        ):
            self._check(path, 'deep')
            self.sync()
        elif path is None:
            raise ValueError(path)
        with self.lock, self.timer as timer:
            return self.made(path, sync=sync, timer=timer)


class File:
    def open(self, path):
        return path
'''


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    """A package of one module, and two tests of it."""
    for path, text in [
        ("semmap_log/room/store.py", MODULE),
        ("semmap_log/page/plan.js", "if (most) draw();"),
        ("tests/room/test_store.py", "def test_open(): pass\n"),
        ("tests/room/test_twice.py", "class TestAll:\n    def test_one(self): pass\n"),
        ("tests/other/test_twice.py", ""),
    ]:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    return Checkout(tmp_path)


def test_each_guard_is_where_the_list_says() -> None:
    """
    Once, in the definition that is named, with tests that are there; and none is named twice.
    """
    here = Checkout(ROOT)
    problems = [problem for mutant in GUARDS if (problem := mutant.problem(here))]

    assert [] == problems
    assert len(GUARDS) == len({mutant.name for mutant in GUARDS})
    assert 650 < len(GUARDS)


@pytest.mark.parametrize(
    ("where", "piece", "put", "line"),
    [
        ("Folder.open", "path and self.most", "True", "  if (\n            (True)\n        ):"),
        ("Folder.open", "if path and self.most:", "if False:", "\n        if False:\n"),
        ("Folder.open", "if path is None:", "if False:", "        elif False:\n            raise"),
        ("Folder.open", "with self.lock, self.timer as timer:", "if True:", "        if True:\n"),
        ("Folder.open", 'self._check(path, "deep")', "", "            pass\n            self.sync"),
        ("Folder.open", "self.sync()", "a = 1\nb = 2", "\n            a = 1\n            b = 2\n"),
        ("Folder.open", "sync=sync", "", "self.made(path, **{}, timer=timer)"),
        ("Folder.open", "sync = sync", "sync=False", "self.made(path, sync=False, timer=timer)"),
        ("Folder.open", "self._check(path, 'deep'); self.sync()", "", "):\n            pass\n"),
        ("File.open", "path", "None", "        return (None)"),
        ("Folder.most", "7", "8", "    most: int = (8)"),
        ("store.MOST", "300", "3", "MOST, LEAST = (3) * 2, 5"),
        ("LEAST", "MOST, LEAST = 300 * 2, 5", "MOST = LEAST = 0", "\nMOST = LEAST = 0\n"),
        ("plan.js", "if (most) ", "", "draw();"),
    ],
)  # fmt: skip
def test_a_piece_is_found_by_its_syntax(
    where: str, piece: str, put: str, line: str, checkout: Checkout
) -> None:
    """
    However it is laid out, and wherever its file lies; and what stands there then is Python.
    """
    mutant = guard("a guard", where, piece, put, "test_store")
    changed = next((checkout.root / "semmap_log").rglob("plan.js" if ".js" in where else "*.py"))
    before = changed.read_text()

    assert "" == mutant.problem(checkout)
    mutant.apply(checkout)

    assert line in changed.read_text()
    assert before != changed.read_text()


@pytest.mark.parametrize(
    ("where", "told", "tests", "problem"),
    [
        ("Folder.close", ("path", ""), (), "expected one definition of 'Folder.close', found 0"),
        (
            "open",
            ("path", "None"),
            (),
            "found 2: semmap_log.room.store.Folder.open, semmap_log.room",
        ),
        ("Folder.open", ("self.size", "0"), (), "expected 'self.size' once, found it 0 times"),
        ("Folder.open", ("path", "None"), (), "expected 'path' once, found it 5 times"),
        ("Folder.open", ("if path", ""), (), "'if path' is no Python"),
        ("Folder.open", ("sync=sync", "sync=sync"), (), "what replaces it is the same"),
        ("Folder.open", ("if path is None:", "while False:"), (), "invalid syntax"),
        ("plan.js", ("if (least)", ""), (), "expected 'if (least)' once, found it 0 times"),
        ("pla.js", ("most", ""), (), "expected one file of that name, found 0"),
        ("File.open", ("path", "1"), ("test_gone",), "one definition of 'test_gone', found 0"),
        ("File.open", ("path", "1"), ("test_twice",), "one definition of 'test_twice', found 2"),
    ],
)
def test_a_list_that_rots_is_noticed(
    where: str, told: tuple[str, str], tests: tuple[str, ...], problem: str, checkout: Checkout
) -> None:
    """
    A definition, a piece or a test that is gone, or not the only one; a mutant that is none.
    """
    mutant = Mutant("a guard", where, *told, tests)

    assert mutant.problem(checkout).startswith(f"a guard: {where}: ")
    assert problem in mutant.problem(checkout)


@pytest.mark.parametrize(
    ("name", "test_id"),
    [
        ("test_store", "tests/room/test_store.py"),
        ("test_open", "tests/room/test_store.py::test_open"),
        ("other.test_twice", "tests/other/test_twice.py"),
        ("TestAll.test_one", "tests/room/test_twice.py::TestAll::test_one"),
    ],
)
def test_tests_are_named_without_their_folder(name: str, test_id: str, checkout: Checkout) -> None:
    """
    A module of tests, or one of its tests; what is there twice, with the folder.
    """
    assert test_id == checkout.test_id(name)


@pytest.mark.slow
def test_a_mutant_is_noticed_and_named() -> None:
    """
    One whole run of the tool: the quickest guard to miss.
    """
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "mutations.py", "left behind"],
        capture_output=True,
        text=True,
        check=False,
    )

    assert 0 == done.returncode, done.stdout + done.stderr
    assert "faults/test_interrupted.py::test_no_" in done.stdout
    assert "1 guards taken out one at a time: 1 noticed, 0 not" in done.stdout
