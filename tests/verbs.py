"""Verbs of the command line, run within this process."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from semmap_log.cli import main


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
