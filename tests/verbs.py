"""Verbs of the command line, run within this process."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from semmap_log.cli import main
from tests.golden_text import GoldenText


class Ran(NamedTuple):
    """What a verb printed, and its exit code."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


Verb = Callable[..., Ran]
"""Runs a verb: the fixture `run_verb` is one."""

Refuses = Callable[[str], None]
"""Checks command lines that fail: the fixture `refuses` is one."""


def run(*words: object) -> int:
    """Run a verb; return its exit code."""
    try:
        main([str(word) for word in words])
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return 0


def ran(capsys: pytest.CaptureFixture[str], *words: object) -> Ran:
    """Run a verb; return its exit code, and what it alone printed."""
    capsys.readouterr()
    return Ran(run(*words), *capsys.readouterr())


def check_refusals(run_verb: Verb, golden: GoldenText, lines: str) -> None:
    """Check that command lines, one a line, fail with exit code and message of golden files."""
    for line in filter(None, map(str.strip, lines.splitlines())):
        code, out, err = run_verb(*shlex.split(line))
        assert code in {1, 2}, line
        assert "Traceback" not in err
        golden(line.split()[0], line, f"exit code {code}\n{out}{_without_usage(err)}")


def _without_usage(err: str) -> str:
    """Return a message without the usage that stands before it where a command line is wrong."""
    return err.partition("\n\n")[2] if err.startswith("Usage:") else err
