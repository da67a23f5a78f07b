"""The list of guards that `tools/mutations.py` takes out is up to date; what it does is long."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from mutation.guards import GUARDS
from mutation.mutant import Mutant

ROOT = Path(__file__).parents[2]


def test_each_guard_is_where_the_list_says() -> None:
    """
    Once, in the file that is named, with tests that are there; and no guard is named twice.
    """
    problems = [problem for mutant in GUARDS if (problem := mutant.problem(ROOT))]

    assert [] == problems
    assert len(GUARDS) == len({mutant.name for mutant in GUARDS})
    assert 50 < len(GUARDS)


@pytest.mark.parametrize(
    ("snippet", "tests", "problem"),
    [
        ("never to be found", (), "found it 0 times"),
        ("import", (), r"found it \d+ times"),
        ("what is no test", ("tests/test_nothing.py",), "there is no tests/test_nothing.py"),
    ],
)
def test_a_list_that_rots_is_noticed(
    snippet: str, tests: tuple[str, ...], problem: str, tmp_path: Path
) -> None:
    """
    A snippet that is gone, or ambiguous, or a test that is gone.
    """
    (tmp_path / "file.py").write_text("import this\nimport that\nwhat is no test\n")
    mutant = Mutant("a guard", "file.py", snippet, "pass", tests)

    assert problem.replace(r"\d+", "2") in mutant.problem(tmp_path)


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
