"""`tail`: the last events as lines, and those to come, in real processes where they wait."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rich.cells import cell_len

import semmap_log as sl
from semmap_log.cli.sanitized_streams import READER_GONE
from semmap_log.core.model.events import RobotPose
from tests.live.ros.running import DEADLINE_S
from tests.verbs import ran


@pytest.fixture
def office(tmp_path: Path) -> Path:
    """A log of two doors and twenty sightings; every second of the front door."""
    path = tmp_path / "office"
    with sl.create(path, tz="Europe/Vienna") as log:
        front = log.add_door(name="front", actor="survey", reason="first round")
        back = log.add_door(name="back")
        for i in range(20):
            log.observe(back if i % 2 else front, "open", at="2026-03-02T14:00:00")
        log.robot_pose(RobotPose(x=1.0, y=2.0, theta=0.0))
    return path


def _said(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[str, str]:
    code, out, err = ran(capsys, "tail", *arguments)
    assert 0 == code, err
    return out, err


def _lines(capsys: pytest.CaptureFixture[str], *arguments: object) -> list[str]:
    return _said(capsys, *arguments)[0].splitlines()


@pytest.fixture
def wide_terminal(terminal: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal in which each event has room in a line."""
    monkeypatch.setenv("COLUMNS", "200")


@pytest.mark.usefixtures("wide_terminal")
def test_ten_lines_unless_told_otherwise(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Number, time in the log's zone, the door's name, what; robot poses only if asked for."""
    lines = _lines(capsys, office)

    assert [str(n) for n in range(14, 24)] == [line.split()[0] for line in lines]
    assert (
        "    23  2026-03-02 14:00:00+01:00  back            seen OPEN"
        == lines[-1].partition("  (recorded")[0]
    )
    assert "(recorded " in lines[-1]
    assert "robot at 1.00, 2.00" in _lines(capsys, office, "-n", 1, "--poses")[0]


@pytest.mark.usefixtures("wide_terminal")
def test_who_and_why_stand_in_brackets(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As the commit says it, behind each of its events."""
    lines = _lines(capsys, office, "-n", 100)

    assert lines[0].endswith("added without a place, UNKNOWN  [survey: first round]")


@pytest.mark.usefixtures("wide_terminal")
def test_the_last_of_one_door(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By its name, however far back its events lie."""
    lines = _lines(capsys, office, "--door", "front", "-n", 12)

    assert ["0", "1", *(str(n) for n in range(4, 24, 2))] == [line.split()[0] for line in lines]


@pytest.mark.parametrize(("after", "expected"), [(-1, 25), (20, 4), (24, 0), (99, 0)])
def test_all_behind_a_position(
    after: int, expected: int, office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """--after counts from the number that the reader had last; JSON has poses, too."""
    lines = _lines(capsys, office, "--json", "--after", after)

    numbers = [json.loads(line)["event"] for line in lines]
    assert list(range(after + 1, after + 1 + expected)) == numbers


@pytest.mark.slow
def test_json_lines_can_be_recorded(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What tail gives, record takes: the same log again."""
    lines = _lines(capsys, office, "--json", "-n", 100)
    copy = office.with_name("copy")
    sl.create(copy, tz="UTC").close()

    done = subprocess.run(
        [sys.executable, "-m", "semmap_log", "record", str(copy)],
        input="\n".join(lines), text=True, capture_output=True, check=False,
    )  # fmt: skip

    assert (0, "") == (done.returncode, done.stdout), done.stderr
    again = _lines(capsys, copy, "--json", "-n", 100)
    assert [_without_recorded(line) for line in lines] == [_without_recorded(x) for x in again]


def _without_recorded(line: str) -> dict[str, object]:
    return {key: value for key, value in json.loads(line).items() if key != "recorded"}


@contextmanager
def _tail(*arguments: object) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "semmap_log", "tail", *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_following_until_ctrl_c(office: Path) -> None:
    """New events come as they are written, a door's new name with them; Ctrl-C is exit code 0."""
    with _tail(office, "-f", "-n", 1) as process:
        assert process.stdout is not None
        head, first = process.stdout.readline(), process.stdout.readline()
        with sl.append(office) as log:
            log.annotate(2, "name", "rear")
            log.observe(2, "closed")
        later = [process.stdout.readline() for _ in range(2)]
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=DEADLINE_S)

    assert head.startswith("event\thappened\t")
    assert ["23", "25", "26"] == [line.split()[0] for line in (first, *later)]
    assert "\trear\tseen CLOSED\t" in later[1]
    assert (0, "", "") == (process.returncode, out, err)


@pytest.mark.slow
def test_a_closed_pipe_ends_it(office: Path) -> None:
    """Also while nothing is written to the log: nobody else would end it."""
    with _tail(office, "-f", "-n", 1) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()

        assert READER_GONE == process.wait(timeout=DEADLINE_S)


@pytest.mark.usefixtures("terminal")
@pytest.mark.parametrize("columns", [24, 40, 80])
def test_no_line_is_wider_than_the_terminal(
    office: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, columns: int
) -> None:
    """What has no room goes on below, indented, and nothing of it is lost."""
    monkeypatch.setenv("COLUMNS", "1000")
    whole = _lines(capsys, office, "--after", -1)
    monkeypatch.setenv("COLUMNS", str(columns))

    folded = _lines(capsys, office, "--after", -1)

    assert max(map(len, folded)) <= columns
    assert "".join("".join(whole).split()) == "".join("".join(folded).split())
    begins = [line for line in folded if line.split()[0].isdecimal()]
    assert len(whole) == len(begins)
    assert set() == {line[:4].strip() for line in folded if line not in begins} - {""}


@pytest.mark.usefixtures("wide_terminal")
def test_names_of_wide_letters_stand_in_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A terminal shows a Chinese letter two columns wide."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for name in ("front", "正面入口"):
            log.observe(log.add_door(name=name), "open")

    seen = [line for line in _lines(capsys, tmp_path / "log") if "seen OPEN" in line]

    first, second = (cell_len(line.partition("seen OPEN")[0]) for line in seen)
    assert first == second


@pytest.mark.parametrize("more", [[], ["--json"], ["--after", -1]], ids=str)
def test_an_empty_log_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[object]
) -> None:
    """On stderr, with what to do: nobody waits for lines that cannot come."""
    sl.create(tmp_path / "log", tz="UTC").close()

    out, told = _said(capsys, tmp_path / "log", *more)

    assert out.count("\n") <= 1
    assert told.startswith("The log has no events yet.")


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["--after", 24], "no events behind 24; the last of the log is 24."),
        (
            ["--door", "front", "--after", 23],
            "no events about door front behind 23; the last of the log is 24.",
        ),
        (["-n", 0], ""),
        (["-n", 1], ""),
    ],
    ids=str,
)
def test_who_asks_for_what_is_not_there_is_told(
    tmp_path: Path, office: Path, capsys: pytest.CaptureFixture[str], asked: list[object], told: str
) -> None:
    """And how far the log goes."""
    assert told == _said(capsys, office, *asked)[1].strip()
