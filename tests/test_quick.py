"""A plain run, `--long` and `--all`: what each runs, and that nothing falls between them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.quick import MOST_CASES

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

@pytest.mark.parametrize("case", range(21))
def test_many(case): pass

@given(st.integers())
def test_property(number): print("EXAMPLE", end=";")
"""
FEW = {f"test_many[{case}]" for case in (0, 4, 8, 12, 16, 20)}
MANY = {f"test_many[{case}]" for case in range(21)}
SLOW = {"test_slow", "test_in_a_real_ros"}


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
        ([], {"test_plain", "test_property"} | FEW),
        (["--long"], {"test_property"} | SLOW | (MANY - FEW)),
        (["--all"], {"test_plain", "test_property"} | SLOW | MANY),
        (["-m", "slow"], {"test_slow"}),
        (["test_it.py::test_slow", "test_it.py::test_many"], {"test_slow"} | MANY),
        (["-k", "test_many and 20"], {"test_many[20]"}),
        (["-n", "2"], {"test_plain", "test_property"} | FEW),
    ],
)
def test_what_is_run(arguments: list[str], expected: set[str], folder: Path) -> None:
    """
    And how many were left out is said where some were, also by two processes.
    """
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", "-p", "no:randomly",
         *arguments],
        cwd=folder, capture_output=True, text=True, check=True,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
    )  # fmt: skip

    ran = set(re.findall(r"test_it.py::(\S+) PASSED|PASSED test_it.py::(\S+)", done.stdout))
    assert expected == {first or second for first, second in ran}
    said = re.search(r"(\d+) long tests left out: pytest --all", done.stdout)
    is_plain = not arguments or "-n" in arguments
    assert (str(len(SLOW | MANY) - len(FEW)) if is_plain else None) == (said and said[1])


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "few"), [([], True), (["--long"], False)])
def test_a_plain_run_tries_fewer_examples(arguments: list[str], few: bool, folder: Path) -> None:
    """
    A long one all of them, also of properties that the plain run has met.
    """
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-s", "-q", "-k", "property", *arguments],
        cwd=folder, capture_output=True, text=True, check=True,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
    )  # fmt: skip

    examples = done.stdout.count("EXAMPLE")
    assert (examples <= 20) is few
    assert examples > MOST_CASES
