"""When compiled loops are used: not if somebody turns them off, none that was made for others."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable

import pytest

from semmap_log.core import loops


@pytest.mark.parametrize("value", ["1", "yes"])
def test_the_environment_turns_them_off(
    turn: Callable[[bool], None], monkeypatch: pytest.MonkeyPatch, value: str
) -> None:
    """By any value but the empty one and 0."""
    turn(True)
    monkeypatch.setenv(loops.WITHOUT, value)
    loops.compiled.cache_clear()

    assert loops.compiled() is None


def test_those_of_another_interface_are_not_used(
    turn: Callable[[bool], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as those that an older version left behind, beside a source that is newer."""
    turn(True)
    monkeypatch.setattr(loops, "INTERFACE", loops.INTERFACE + 1)
    loops.compiled.cache_clear()

    assert loops.compiled() is None


def test_where_none_were_built_there_are_none(
    turn: Callable[[bool], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numpy does it all."""
    turn(True)
    monkeypatch.setitem(sys.modules, "semmap_log.core.loops.native", None)
    loops.compiled.cache_clear()

    assert loops.compiled() is None


@pytest.mark.parametrize(("value", "expected"), [("0", "with"), ("1", "without")])
def test_the_version_says_which(turn: Callable[[bool], None], value: str, expected: str) -> None:
    """A report of how long something takes needs it."""
    turn(True)

    done = subprocess.run(
        [sys.executable, "-m", "semmap_log", "--version"],
        env={**os.environ, loops.WITHOUT: value},
        capture_output=True,
        text=True,
        check=True,
    )

    assert f"({expected} compiled loops)" in done.stdout
