"""The README tells the truth: its Python runs, its commands run, its links lead somewhere."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_S = 1800
"""For all commands, which took eight minutes beside ten busy processes."""


def _blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_python_example_runs(tmp_path: Path) -> None:
    """
    As it stands, in an empty folder.
    """
    (code,) = _blocks("python")

    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )

    assert done.stdout.startswith("OPEN\n")


@pytest.mark.slow
@pytest.mark.timeout(MOST_S)
def test_the_commands_run_as_they_stand(tmp_path: Path) -> None:
    """
    One after the other; where the viewer would show a recording, that is only written.
    """
    (tmp_path / "recordings").symlink_to(ROOT / "recordings")
    program = f"{shlex.quote(sys.executable)} -m semmap_log"
    for block in _blocks("sh")[2:]:
        commands = re.sub(r"semmap-log view (\S+).*", r"semmap-log view \1 --save x.rrd", block)
        commands = commands.replace("semmap-log", program)
        done = subprocess.run(
            ["bash", "-euc", commands], cwd=tmp_path, capture_output=True, text=True, check=False
        )

        assert 0 == done.returncode, f"{commands}\n{done.stderr}"


def test_the_two_commands_are_where_ci_looks_for_them() -> None:
    """
    CI runs the second one as the reader would.
    """
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


@pytest.mark.parametrize("name", ["README.md", "recordings/README.md", "CHANGELOG.md"])
def test_links_lead_somewhere(name: str) -> None:
    """
    Every relative link is a file of the project, or a heading.
    """
    text = (ROOT / name).read_text(encoding="utf-8")

    links = [link for link in re.findall(r"\]\(([^)]+)\)", text) if "://" not in link]

    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    anchors = {"#" + re.sub(r"[^a-z0-9 -]", "", h.lower()).replace(" ", "-") for h in headings}
    here = (ROOT / name).parent
    assert [] == [link for link in links if link not in anchors and not (here / link).exists()]
