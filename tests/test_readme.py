"""The README's two commands are where CI looks for them; what else it tells, `tests/docs` tries."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_the_two_commands_are_where_ci_looks_for_them() -> None:
    """CI runs the second one as the reader would."""
    script = ROOT / ".ci" / "readme_command.py"

    first, second = (
        subprocess.run(
            [sys.executable, script, n], capture_output=True, text=True, check=True
        ).stdout
        for n in ("1", "2")
    )

    assert first.strip().endswith("semmap-log demo")
    assert "pytest" in second
    assert all(".[viewer,test]" in command for command in (first, second))
