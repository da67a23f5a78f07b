"""The page about planners, run with the server that it starts beside it."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from doc_pages import ROOT, Runner, blocks_of

from tests.live.ros.running import Running

PAGE = (ROOT / "docs" / "guides" / "planners.md").read_text(encoding="utf-8")
(SERVE,) = re.findall(r"^```bash\nsemmap-log (serve .*)$", PAGE, flags=re.MULTILINE)
PRINTED = "0.75\n['DOOR_1']\n"
"""What the program's comments say."""


@pytest.mark.slow
def test_what_the_page_says_about_planners(tmp_path: Path) -> None:
    """Its log, its server, its questions, and the client in Python, which is short."""
    runner, (first, *others) = Runner(tmp_path), blocks_of(PAGE)
    runner.run(first)
    command = [sys.executable, "-m", "semmap_log", *shlex.split(SERVE, comments=True)]
    out, err = tmp_path / "stdout", tmp_path / "stderr"
    with out.open("wb") as stdout, err.open("wb") as stderr:
        process = subprocess.Popen(command, cwd=runner.folder, stdout=stdout, stderr=stderr)
    with Running(process, SERVE, tmp_path) as server:
        server.wait_for("questions are taken at unix:")
        for block in others:
            runner.run(block)
        (program,) = [block.text for block in others if block.language == "python"]
        done = subprocess.run(
            [sys.executable, "-c", program], cwd=runner.folder, capture_output=True, text=True,
            check=True,
        )  # fmt: skip
        assert 0 == server.stop()

    assert PRINTED == done.stdout
    assert ["console", "python"] == [block.language for block in others]
    assert 20 > len([line for line in program.splitlines() if line])
