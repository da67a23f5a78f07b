"""`play` and `call` as a person types them, where there is no ROS."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli.play import _status_line
from semmap_log.interop.exporting.stream import log_stream
from tests.conftest import SteadyClock
from tests.verbs import Refuses, Verb
from tests.views.rerun.some_logs import SECOND, START, small_log

PLACE = ["--x", "1", "--y", "1", "--theta", "0", "--width", "1"]


@pytest.fixture
def run(run_verb: Verb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Verb:
    """Run a verb beside a log `office`, and an empty one, `new`."""
    monkeypatch.chdir(tmp_path)
    small_log(tmp_path / "office")
    sl.create(tmp_path / "new", tz="UTC", clock=SteadyClock(START)).close()

    return run_verb


def test_what_cannot_be_played_is_refused(run: Verb, refuses: Refuses) -> None:
    """Before ROS is joined, with the way out."""
    refuses("""
        play office
        play office --ros1 --ros2
        play office --ros1 --rate 0
        play office --ros1 --rate -1
        play office --ros2 --rate nan
        play office --ros2 --rate inf
        play office --ros2 --skip-empty nan
        play office --ros2 --skip-empty inf
        play office --ros2 --palette default
        play office --ros2 --default-prob 2
        play office --ros1 --since 12:00 --until 11:00
        play new --ros1
        play nowhere --ros1
    """)


def test_a_person_sees_where_in_the_log_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The log's time, how much of it is over."""
    log = small_log(tmp_path / "log")
    stream = log_stream(log, ros_version=2)
    show = _status_line(stream, rate=10.0)

    for at_s in (600, 600, 3599):
        show(START + at_s * SECOND, START + 3600 * SECOND)

    drawn = capsys.readouterr().err.split("\r\x1b[2K")
    assert [
        "",
        "2026-03-01 21:30:00   17%  next in 5 min\r",
        "2026-03-01 22:19:59  100%\r",
    ] == drawn


def test_what_cannot_be_called_is_refused(run: Verb, refuses: Refuses) -> None:
    """Before ROS is joined, with exit code 2 and what is missing."""
    refuses("""
        call add --x 1 --y 1 --theta 0 --width 1
        call add --ros1 --x 1 --y 1 --theta 0
        call add --ros1 --x 1 --y 1 --theta 0 --width 1 --from 1,2 --to 1,3
        call add --ros1 --x 1 --y 1 --theta 0 --width 1 --state ajar
        call update 1 --ros2 --state moving
        call update 1 --ros2
        call update 1 --ros2 --prob-open 1.2
        call update 1 --ros2 --x nan
        call remove -1 --ros2
        call remove front --ros2
        call remove 1 --ros2 --timeout nan
        call save --ros2
    """)


@pytest.mark.parametrize("ros", ["1", "2"])
@pytest.mark.parametrize("arguments", [["play", "office"], ["call", "remove", "1"]])
def test_where_that_ros_is_not_it_is_said_how_to_have_it(
    run: Verb, arguments: list[str], ros: str
) -> None:
    """One line, exit code 1."""
    if find_spec({"1": "rospy", "2": "rclpy"}[ros]):
        pytest.skip(f"ROS {ros} is there for this Python")

    done, out, err = run(*arguments, f"--ros{ros}")

    assert (1, "") == (done, out)
    assert err.startswith(f"semmap-log: ROS {ros} is not there for this Python")
