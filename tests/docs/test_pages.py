"""The documentation tells the truth: what its pages run runs, and prints what they show."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path

import pytest
from doc_pages import ROOT, Block, Runner, WrongOutput, blocks_of, examples_of, fits
from typer.main import get_command

from semmap_log.cli.app import app

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
READER = "log_format.md"
"""Its program wants a log: `test_log_format` runs it."""
WITH_A_SERVER = "planners.md"
"""Its questions want a server beside them: `test_planners_page` runs it."""
OF_PLANNERS = [path.name for path in PAGES if path.name.startswith("planners_")]
"""They want planners that may not be here: `test_planner_pages` runs them."""
WITH_A_BAG = "doors_from_a_laser.md"
"""Its commands want a bag with scans: `test_laser_page` runs it."""
SET_UP = "python3 -m venv"
"""What begins with it installs the project: CI runs it, from the README."""


def _to_run(path: Path) -> list[Block]:
    blocks = blocks_of(path.read_text(encoding="utf-8"))
    return [block for block in blocks if not block.text.startswith(SET_UP)]


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    "path",
    [
        path
        for path in PAGES
        if path.name not in (READER, WITH_A_SERVER, WITH_A_BAG, *OF_PLANNERS) and _to_run(path)
    ],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_what_a_page_runs_does_what_it_says(path: Path, tmp_path: Path) -> None:
    """All of its examples, one after the other, in one fresh folder."""
    runner = Runner(tmp_path)

    for block in _to_run(path):
        runner.run(block)


def test_the_examples_are_many() -> None:
    """So that a change of how blocks are written does not silently run none."""
    languages = [block.language for path in PAGES for block in _to_run(path)]

    assert 20 < languages.count("console") + languages.count("sh")
    assert 8 < languages.count("pycon") + languages.count("python")


_MADE = re.compile(
    r"semmap-log init (\S+)|sl\.create\(\"([^\"]+)|cp -r recordings/\S+ (\S+)"
    r"|mkdir (?:-p )?([^\s;]+)"
)


def test_what_a_page_makes_is_called_otherwise_than_what_others_make() -> None:
    """So that they can be followed one after the other, in one folder."""
    makers: dict[str, set[str]] = {}
    fenced = re.compile(r"^```\w+\n(.*?)^```$", re.DOTALL | re.MULTILINE)
    for path in PAGES:
        for block in fenced.findall(path.read_text(encoding="utf-8")):
            for made in _MADE.findall(block):
                makers.setdefault("".join(made), set()).add(path.name)

    assert {"office", "house", "library", "museum"} <= makers.keys()
    assert {} == {name: pages for name, pages in makers.items() if len(pages) > 1}


def _lines(path: Path) -> list[str]:
    """Return the commands of a page's blocks that are not run, as shell words can be told."""
    text = path.read_text(encoding="utf-8")
    blocks = "".join(re.findall(r"^```bash\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE))
    return re.findall(r"^semmap-log .*$", blocks.replace("\\\n", " "), flags=re.MULTILINE)


@pytest.mark.parametrize(
    "line",
    [pytest.param(line, id=f"{path.name}: {line}"[:80]) for path in PAGES for line in _lines(path)],
)
def test_what_a_page_does_not_run_has_verbs_and_options_that_there_are(line: str) -> None:
    """A verb or an option that was renamed is noticed also where ROS or a screen is wanted."""
    verb, words = get_command(app), shlex.split(line, comments=True)[1:]
    while commands := getattr(verb, "commands", None):
        verb, words = commands[words[0]], words[1:]

    known = {option for param in verb.params for option in param.opts}

    assert set() == {word for word in words if word.startswith("--")} - known


@pytest.mark.parametrize(
    ("block", "problem"),
    [
        (Block("console", "$ echo one\ntwo\n", 1), "expected:\ntwo\ngot:\none"),
        (Block("console", "$ echo one\n", 1), "got:\none"),
        (Block("sh", "true\nfalse\ntrue\n", 1), "line 1"),
        (Block("python", "1 / 0\n", 1), "ZeroDivisionError"),
        (Block("pycon", ">>> 1 + 1\n3\n", 1), "Got:\n    2"),
    ],
    ids=["wrong output", "output left out", "exit code", "program", "session"],
)
def test_a_wrong_example_is_noticed(block: Block, problem: str, tmp_path: Path) -> None:
    """Whatever it is wrong about."""
    with pytest.raises(WrongOutput, match=re.escape(problem)):
        Runner(tmp_path).run(block)


def test_times_of_the_last_minutes_stand_for_each_other_and_no_others_do() -> None:
    """A page shows the time when it was written; of a recording it shows the recording's."""
    now = datetime.now(timezone.utc)
    printed = f"event 2 at {now:%Y-%m-%d %H:%M:%S}, 3 s ago"

    assert fits("event 2 at 2026-01-02 03:04:05, 17 s ago", printed)
    assert fits("event ...", printed)
    assert not fits("event 3 at 2026-01-02 03:04:05, 17 s ago", printed)
    assert not fits("2026-03-02 10:00:00, 2 h ago", "2026-03-02 11:00:00, 2 h ago")


def test_a_command_may_take_several_lines() -> None:
    """As in a shell, a backslash at the end joins the next."""
    console = "$ one \\\n    two\nsaid\n$ three\n"

    assert [("one \\\n    two", "said"), ("three", "")] == examples_of(console)


def test_the_set_up_of_the_quickstart_is_the_readmes() -> None:
    """Told in two places for who begins at either, and the same."""
    first, quick = (
        re.findall(rf"^{SET_UP}.*$", (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)[0]
        for name in ("README.md", "docs/quickstart.md")
    )

    assert first == quick


@pytest.mark.parametrize(
    ("name", "printed"),
    [("README.md", "OPEN\n"), ("docs/guides/python.md", "OPEN\n{1: 1}\n{1: 1}\n")],
)
def test_a_program_prints_what_its_comments_say(name: str, printed: str, tmp_path: Path) -> None:
    """In an empty folder, without the page's other examples."""
    page = (ROOT / name).read_text(encoding="utf-8")
    (program,) = [block.text for block in blocks_of(page) if block.language == "python"]

    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True
    )

    assert printed == done.stdout
