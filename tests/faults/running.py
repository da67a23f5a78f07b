"""How a test runs a short form of `tools/faults.py`, in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest

TOOLS = Path(__file__).parents[2] / "tools"


def faults(kind: str, count: int, folder: Path, *more: str) -> dict[str, Any]:
    """Return what came of so many faults of a kind; what went wrong is kept in that folder.

    Skips, aloud, what this machine cannot do.
    """
    command = [sys.executable, TOOLS / "faults.py", kind, "--faults", str(count), "--json",
               "--keep", folder / "kept", *more]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=550)
    assert done.returncode in {0, 1}, done.stderr
    (said,) = json.loads(done.stdout)["kinds"]
    if said["skipped"]:
        warnings.warn(f"NOT TRIED: faults of kind {kind}: {said['skipped']}", stacklevel=2)
        pytest.skip(said["skipped"])
    return dict(said)


def is_tried(said: dict[str, Any], *, at_least: int) -> None:
    """Check that so many faults were tried, and that nothing was lost, invented or broken."""
    assert [] == said["bad"], said["bad"]
    assert (0, 0) == (said["lost"], said["invented"])
    assert at_least <= said["faults"]
