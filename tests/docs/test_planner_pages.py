"""The pages about planners that are not ours, each run with what it is about, and its server.

That of OPRS needs an OpenPRS that was built: SEMMAP_OPRS names its folder.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

import pytest
from doc_pages import ROOT, Block, Runner, WrongOutput, blocks_of

from tests.live.ros.running import Running

GUIDES = ROOT / "docs" / "guides"
NEEDS = {
    "planners_pddl.md": ("pyperplan", "unified_planning", "up_fast_downward"),
    "planners_prolog.md": ("swipl",),
    "planners_behaviour_trees.md": ("py_trees",),
    "planners_oprs.md": ("oprs",),
}
"""Page -> programs and Python modules."""
_SERVE = re.compile(r"^```bash\nsemmap-log (serve .*)$", re.MULTILINE)
_FILE = re.compile(r"^```\w+\n(?:%|;;;) (\S+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_SAID = re.compile(r"\n*```text\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def _missing(page: str) -> list[str]:
    return [name for name in NEEDS[page] if not (shutil.which(name) or find_spec(name))]


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("page", NEEDS)
def test_what_the_page_runs_does_what_it_says(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From nothing to the answers; a part that needs what is not installed is left out, by name."""
    text = (GUIDES / page).read_text(encoding="utf-8")
    if oprs := os.environ.get("SEMMAP_OPRS"):
        monkeypatch.setenv("OPRS", oprs)
        monkeypatch.setenv("PATH", f"{os.environ['PATH']}{os.pathsep}{oprs}/src")
    missing = _missing(page)
    runner = Runner(tmp_path)
    for name, program in _FILE.findall(text):
        (tmp_path / name).write_text(program, encoding="utf-8")
    served = _SERVE.search(text)
    line = text.count("\n", 0, served.start()) if served else 0
    left_out = 0

    with ExitStack() as running:
        for block in blocks_of(text):
            if served and block.line > line:
                running.enter_context(_running(runner, served[1]))
                served = None
            if any(name in block.text for name in missing):
                left_out += 1
            elif block.language == "python":
                _compare(_said_below(text, block), _output_of(runner, block))
            else:
                runner.run(block)

    if left_out:
        pytest.skip(f"{left_out} of its examples need what is not here: {', '.join(missing)}")


def test_a_node_fails_where_nobody_answers(tmp_path: Path) -> None:
    """The page's program without a server: its tree ends, and says why."""
    pytest.importorskip("py_trees", reason="pip install py_trees")
    text = (GUIDES / "planners_behaviour_trees.md").read_text(encoding="utf-8")
    (program,) = [block for block in blocks_of(text) if block.language == "python"]

    said = _output_of(Runner(tmp_path), program)

    assert "{o} through the front [✕]" in said
    assert "--> front: set open [✕] -- [Errno 2] No such file or directory" in said


def test_the_pages_are_all_that_there_are() -> None:
    """One that comes has to be put into the table here."""
    assert NEEDS.keys() == {path.name for path in GUIDES.glob("planners_*.md")}


def _running(runner: Runner, command: str) -> Running:
    """Start a server; it is stopped with the page."""
    out, err = runner.folder / "stdout", runner.folder / "stderr"
    words = [sys.executable, "-m", "semmap_log", *shlex.split(command, comments=True)]
    with out.open("wb") as stdout, err.open("wb") as stderr:
        process = subprocess.Popen(words, cwd=runner.folder, stdout=stdout, stderr=stderr)
    server = Running(process, command, runner.folder)
    server.wait_for("questions are taken at")
    return server


def _output_of(runner: Runner, block: Block) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "error::ResourceWarning", "-c", block.text], cwd=runner.folder,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise WrongOutput(f"line {block.line}: {done.stdout}{done.stderr}")
    return done.stdout


def _said_below(text: str, block: Block) -> str:
    """Return what a page says that a program prints: the block behind it."""
    (begin,) = _offsets(text, block.text)
    found = _SAID.match(text, begin + len(block.text) + len("```"))
    assert found, f"line {block.line}: expected a block of text behind it"
    return found[1]


def _offsets(text: str, part: str) -> Iterator[int]:
    return (found.start() for found in re.finditer(re.escape(part), text))


def _compare(expected: str, got: str) -> None:
    lines = [[line.rstrip() for line in text.strip("\n").splitlines()] for text in (expected, got)]
    assert lines[0] == lines[1]
