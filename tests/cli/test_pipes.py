"""Tables in a pipe and in terminals of any width, colours, and a reader that goes away."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli.sanitized_streams import READER_GONE

SEMMAP = [sys.executable, "-m", "semmap_log"]
LONG_NAME = "the second door of the long corridor behind the\tkitchen\nof the canteen"
HISTORY = [
    "event", "happened", "recorded", "kind", "door_id", "door", "what", "actor", "source", "reason"
]  # fmt: skip


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two doors, one of a name that no terminal holds, sightings and a change of mind."""
    path = tmp_path_factory.mktemp("pipes") / "log"
    with sl.create(path, tz="UTC") as log:
        door = log.add_door(
            x=1.25, y=2, theta=0, width=0.9, state="closed", name=LONG_NAME, prob_open=0.5
        )
        log.add_door(x=3, y=2, theta=0, width=0.9, name="front")
        log.observe(door, "open", accuracy=0.9, actor="rover", reason="a reason " * 20)
        log.update_door(door, state="closed", actor="porter")
    return path


def _run(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*SEMMAP, *map(str, arguments)], capture_output=True, text=True, check=False,
        env=os.environ | environment, timeout=200,
    )  # fmt: skip


def _in_terminal(columns: int, *arguments: object, **environment: str) -> tuple[str, str]:
    """Return what a terminal of that width gets as stdout; and stderr, which is none."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    known = {k: v for k, v in os.environ.items() if k not in {"COLUMNS", "NO_COLOR", "FORCE_COLOR"}}
    process = subprocess.Popen(
        [*SEMMAP, *map(str, arguments)], stdin=theirs, stdout=theirs, stderr=subprocess.PIPE,
        env=known | {"TERM": "xterm-256color"} | environment,
    )  # fmt: skip
    os.close(theirs)
    said = b""
    while chunk := _read(ours):
        said += chunk
    os.close(ours)
    assert process.stderr is not None
    complaints = process.stderr.read().decode()
    process.stderr.close()
    assert 0 == process.wait(200), complaints
    return said.decode(), complaints


def _read(fd: int) -> bytes:
    try:
        return os.read(fd, 2**16)
    except OSError:  # the other end is closed
        return b""


def _name_of(value: object) -> str:
    return " ".join(value) if isinstance(value, list) else str(value)


def _plain(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text).replace("\r", "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("verb", "rows"),
    [
        (["replay"], 2),
        (["history"], 6),
        (["tail"], 6),
        (["timeline", "1"], 3),
        (["probabilities"], 2),
        (["probabilities", "--by", "hour"], 48),
        (["probabilities", "--by", "weekday"], 14),
        (["probabilities", "--by", "week"], 336),
        (["show", "0"], None),
        (["info"], None),
    ],
    ids=_name_of,
)
def test_each_row_of_a_pipe_is_a_line_of_as_many_cells_as_the_head(
    log: Path, verb: list[str], rows: int | None
) -> None:
    """However narrow COLUMNS says that it is, and whatever a name holds."""
    done = _run(verb[0], log, *verb[1:], COLUMNS="30")

    assert 0 == done.returncode, done.stderr
    head, *lines = done.stdout.split("\n\n")[0].rstrip("\n").split("\n")
    assert {head.count("\t")} == {line.count("\t") for line in lines}
    assert 1 <= head.count("\t")
    assert rows in (None, len(lines))


@pytest.mark.slow
def test_cut_takes_the_columns(log: Path) -> None:
    """The same cells under the same names as `history` and `tail` have; line ends are spelt."""
    done = _run("history", log)
    tail = _run("tail", log)

    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert HISTORY == rows[0]
    assert ["0", "1", "2", "3", "4", "5"] == [row[0] for row in rows[1:]]
    assert {
        r"the second door of the long corridor behind the\tkitchen\nof the canteen",
        "front",
    } == {row[5] for row in rows[1:]}
    assert "rover" == rows[5][7]
    assert ("a reason " * 20) == rows[5][9]
    assert HISTORY == tail.stdout.splitlines()[0].split("\t")
    assert [row[:6] for row in rows] == [line.split("\t")[:6] for line in tail.stdout.splitlines()]


@pytest.mark.slow
def test_columns_of_a_pipe_do_not_depend_on_what_doors_have(tmp_path: Path, log: Path) -> None:
    """A script that takes the ninth column takes it of every log."""
    with sl.create(tmp_path / "bare", tz="UTC"):
        pass

    bare, full = (_run("replay", path).stdout.splitlines() for path in (tmp_path / "bare", log))

    assert bare == full[:1]
    assert ["id", "x", "y"] == [full[0].split("\t")[n].removeprefix("door_") for n in (0, 3, 4)]


@pytest.mark.slow
def test_what_is_said_about_a_table_is_not_in_the_pipe(log: Path) -> None:
    """Which moment it is of: on stderr."""
    done = _run("replay", log)

    assert "up to event 5" not in done.stdout
    assert "2 doors, up to event 5\n" == done.stderr


def test_two_tables_have_an_empty_line_between(log: Path) -> None:
    """As `diff` has: what differs, and the events that did it."""
    doors, events = _run("diff", log, "event:1", "event:5").stdout.split("\n\n")

    assert ["door_id", "name", "what", "before", "after"] == doors.splitlines()[0].split("\t")
    assert HISTORY == events.splitlines()[0].split("\t")


@pytest.mark.slow
@pytest.mark.parametrize(
    "verb",
    [
        ["history"], ["history", "--json"], ["replay"], ["record", "--help"], ["info"],
        ["tail", "-n", "3"], ["--help"], ["verify"], ["verify", "--json"], ["best-time", "1"],
        ["rooms", "--json"], ["replay", "--nope", "--json"],
    ],
    ids=_name_of,
)  # fmt: skip
@pytest.mark.parametrize("unbuffered", ["", "1"], ids=["buffered", "unbuffered"])
def test_a_reader_that_goes_ends_it_quietly(log: Path, verb: list[str], unbuffered: str) -> None:
    """As SIGPIPE ends any program: no complaint, and the same exit code in a shell."""
    arguments = verb if verb[-1] == "--help" else [verb[0], str(log), *verb[1:]]
    reads, writes = os.pipe()
    os.close(reads)

    done = subprocess.run(
        [*SEMMAP, *arguments], stdout=writes, stderr=subprocess.PIPE, text=True, check=False,
        env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
    )  # fmt: skip

    os.close(writes)
    assert READER_GONE == done.returncode
    assert not re.search("Traceback|Broken pipe|semmap-log: |Error", done.stderr), done.stderr


@pytest.mark.slow
def test_the_table_is_whole_where_only_the_reader_of_stderr_goes(log: Path) -> None:
    """What stands around it is lost, not the table."""
    reads, writes = os.pipe()
    os.close(reads)

    done = subprocess.run(
        [*SEMMAP, "replay", log], stdout=subprocess.PIPE, stderr=writes, text=True, check=False,
        env=os.environ | {"PYTHONUNBUFFERED": ""},
    )  # fmt: skip

    os.close(writes)
    assert done.stdout == _run("replay", log).stdout


@pytest.mark.slow
def test_a_narrow_terminal_leaves_columns_out_and_says_so(log: Path) -> None:
    """The least important ones; every line fits, no number is cut, and the name is all there."""
    (wide, nothing), (narrow, note) = (_in_terminal(width, "replay", log) for width in (80, 50))

    assert "theta" in _plain(wide).splitlines()[1]
    assert "" == nothing
    assert note.startswith("left out, as 50 columns are too narrow: ")
    assert "theta, width" in note
    table = _plain(narrow).splitlines()
    assert max(map(len, table)) <= 50
    assert "theta" not in "".join(table)
    assert "CLOSED" in narrow
    assert "…" not in narrow
    folded = "".join(line[3:17].strip() for line in table)
    assert "kitchen" in folded


@pytest.mark.slow
@pytest.mark.parametrize("columns", [30, 40, 80])
@pytest.mark.parametrize(
    "verb",
    [["history"], ["info"], ["tail"], ["replay"], ["show", "1"], ["diff", "event:1", "now"],
     ["probabilities", "--by", "hour"], ["probabilities", "--by", "weekday"], ["probabilities"],
     ["timeline", "1"]],
    ids=_name_of,
)  # fmt: skip
def test_tables_fit_any_terminal(log: Path, verb: list[str], columns: int) -> None:
    """What is drawn is no wider than the terminal, so that it does not break rows."""
    drawn, left_out = _in_terminal(columns, verb[0], log, *verb[1:])

    if verb[0] in {"history", "diff", "tail"}:
        assert "canteen" in "".join(drawn.split())
        assert "what" not in left_out
    wide = [line for line in _plain(drawn).splitlines() if len(line.rstrip()) > columns]
    assert [] == [line for line in wide if not line.startswith("  semmap-log ")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("environment", "has_colours"),
    [
        ({}, True),
        ({"NO_COLOR": ""}, True),
        ({"NO_COLOR": "1"}, False),
        ({"NO_COLOR": "1", "FORCE_COLOR": "1"}, False),
        ({"CLICOLOR": "0"}, False),
        ({"TERM": "dumb"}, False),
    ],
    ids=str,
)
def test_colours_of_a_terminal(
    log: Path, environment: dict[str, str], *, has_colours: bool
) -> None:
    """Unless the environment says no: https://no-color.org."""
    said, _ = _in_terminal(80, "replay", log, **environment)

    assert has_colours == ("\x1b[31m" in said)


@pytest.mark.slow
@pytest.mark.parametrize("variable", ["FORCE_COLOR", "CLICOLOR_FORCE"])
def test_lines_for_programs_never_have_colours(log: Path, variable: str) -> None:
    """A script must not break where CI asks everybody for colours."""
    assert _run("replay", log).stdout == _run("replay", log, **{variable: "1"}).stdout
