"""A plain run, `--long` and `--all`: what each runs, and that nothing falls between them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
HOOKS = [
    "pytest_addoption",
    "pytest_collection_modifyitems",
    "pytest_configure",
    "pytest_sessionfinish",
    "pytest_terminal_summary",
    "pytest_testnodedown",
]
TESTS = """
import pytest
from hypothesis import given, settings, strategies as st

@pytest.fixture
def ros1(): pass

def test_plain(): pass

@pytest.mark.slow
def test_slow(): pass

def test_in_a_real_ros(ros1): pass

@pytest.mark.parametrize("case", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_cases(case): pass

@given(st.integers())
def test_property(number): print("EXAMPLE", end=";")
"""
QUICK = {"test_plain", "test_cases[1]", "test_property"}
SLOW = {"test_slow", "test_cases[2]", "test_in_a_real_ros"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Some tests, by the same rule as ours."""
    (tmp_path / "conftest.py").write_text(f"from tests.quick import {', '.join(HOOKS)}\n")
    (tmp_path / "test_it.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = slow\n")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([], QUICK),
        (["--long"], {"test_property"} | SLOW),
        (["--all"], QUICK | SLOW),
        (["-m", "slow"], {"test_slow", "test_cases[2]"}),
        (["test_it.py::test_slow", "test_it.py::test_cases"],
         {"test_slow", "test_cases[1]", "test_cases[2]"}),
        (["-k", "plain"], {"test_plain"}),
        (["-n", "2"], QUICK),
    ],
)  # fmt: skip
def test_what_is_run(arguments: list[str], expected: set[str], folder: Path) -> None:
    """And how many were left out is said where some were, also by two processes."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", "-p", "no:randomly",
         *arguments],
        cwd=folder, capture_output=True, text=True, check=True,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
    )  # fmt: skip

    ran = set(re.findall(r"test_it.py::(\S+) PASSED|PASSED test_it.py::(\S+)", done.stdout))
    assert expected == {first or second for first, second in ran}
    said = re.search(r"(\d+) long tests left out: pytest --all", done.stdout)
    is_plain = arguments[:1] in ([], ["-k"]) or "-n" in arguments
    assert (str(len(SLOW)) if is_plain else None) == (said and said[1])


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "few"), [([], True), (["--long"], False)])
def test_a_plain_run_tries_fewer_examples(arguments: list[str], few: bool, folder: Path) -> None:
    """A long one all of them, also of properties that the plain run has met."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-s", "-q", "-k", "property", *arguments],
        cwd=folder, capture_output=True, text=True, check=True,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
    )  # fmt: skip

    examples = done.stdout.count("EXAMPLE")
    assert (examples <= 20) is few
    assert examples > 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "runs"),
    [([], False), (["--long"], True), (["--all"], True), (["tools/experiments"], True),
     (["--all", "here"], False), (["--all", "-n", "2"], True)],
)  # fmt: skip
def test_experiments_run_with_all_or_where_they_are_named(
    arguments: list[str], runs: bool, folder: Path
) -> None:
    """A plain run does not even import them."""
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = slow\ntestpaths = here\n")
    (folder / "here").mkdir()
    (folder / "test_it.py").rename(folder / "here" / "test_it.py")
    (folder / "tools" / "experiments").mkdir(parents=True)
    (folder / "tools" / "experiments" / "test_far.py").write_text(
        "from pathlib import Path\nPath('imported').touch()\ndef test_far(): pass\n"
    )

    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", *arguments],
        cwd=folder, capture_output=True, text=True, check=True,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
    )  # fmt: skip

    assert ("test_far.py::test_far" in done.stdout) is runs
    assert (folder / "imported").exists() is runs
