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

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.cli.verbs import READER_GONE
from semmap_log.events import RobotPose
from tests.live.running import DEADLINE_S


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


def _lines(capsys: pytest.CaptureFixture[str], *arguments: object) -> list[str]:
    with pytest.raises(SystemExit, match=r"^0$"):
        main(["tail", *map(str, arguments)])
    return capsys.readouterr().out.splitlines()


@pytest.mark.usefixtures("terminal")
def test_ten_lines_unless_told_otherwise(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """
    Number, time in the log's zone, the door's name, what; robot poses only if asked for.
    """
    lines = _lines(capsys, office)

    assert [str(n) for n in range(14, 24)] == [line.split()[0] for line in lines]
    assert (
        "    23  2026-03-02 14:00:00+01:00  back            seen OPEN"
        == lines[-1].partition("  (recorded")[0]
    )
    assert "(recorded " in lines[-1]
    assert "robot at 1.00, 2.00" in _lines(capsys, office, "-n", 1, "--poses")[0]


@pytest.mark.usefixtures("terminal")
def test_who_and_why_stand_in_brackets(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """
    As the commit says it, behind each of its events.
    """
    lines = _lines(capsys, office, "-n", 100)

    assert lines[0].endswith("added without a place, UNKNOWN  [survey: first round]")


@pytest.mark.usefixtures("terminal")
def test_the_last_of_one_door(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """
    By its name, however far back its events lie.
    """
    lines = _lines(capsys, office, "--door", "front", "-n", 12)

    assert ["0", "1", *(str(n) for n in range(4, 24, 2))] == [line.split()[0] for line in lines]


@pytest.mark.parametrize(("after", "expected"), [(-1, 25), (20, 4), (24, 0), (99, 0)])
def test_all_behind_a_position(
    after: int, expected: int, office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """
    --after counts from the number that the reader had last; JSON has poses, too.
    """
    lines = _lines(capsys, office, "--json", "--after", after)

    numbers = [json.loads(line)["event"] for line in lines]
    assert list(range(after + 1, after + 1 + expected)) == numbers


@pytest.mark.slow
def test_json_lines_can_be_recorded(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """
    What tail gives, record takes: the same log again.
    """
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
    """
    New events come as they are written, a door's new name with them; Ctrl-C is exit code 0.
    """
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
    """
    Also while nothing is written to the log: nobody else would end it.
    """
    with _tail(office, "-f", "-n", 1) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()

        assert READER_GONE == process.wait(timeout=DEADLINE_S)
