"""`play` and `call` as a person types them, where there is no ROS."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli.play import _status_line
from semmap_log.interop.exporting.stream import log_stream
from tests.conftest import SteadyClock
from tests.verbs import Verb
from tests.views.rerun.some_logs import SECOND, START, small_log

PLACE = ["--x", "1", "--y", "1", "--theta", "0", "--width", "1"]


@pytest.fixture
def run(run_verb: Verb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Verb:
    """Run a verb beside a log `office`, and an empty one, `new`."""
    monkeypatch.chdir(tmp_path)
    small_log(tmp_path / "office")
    sl.create(tmp_path / "new", tz="UTC", clock=SteadyClock(START)).close()

    return run_verb


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["office"], 2, "say which ROS: --ros1 or --ros2"),
        (["office", "--ros1", "--ros2"], 2, "say which ROS: --ros1 or --ros2"),
        (["office", "--ros1", "--rate", "0"], 2, "from 0.001 to 1e+09, got 0; --immediate does"),
        (["office", "--ros1", "--rate", "-1"], 2, "from 0.001 to 1e+09, got -1"),
        (["office", "--ros2", "--rate", "nan"], 2, "not a number"),
        (["office", "--ros2", "--rate", "inf"], 2, "--immediate does not wait"),
        (["office", "--ros2", "--skip-empty", "nan"], 2, "--skip-empty"),
        (["office", "--ros2", "--skip-empty", "inf"], 2, "--skip-empty"),
        (["office", "--ros2", "--palette", "default"], 2, "--palette: only with --markers"),
        (["office", "--ros2", "--default-prob", "2"], 2, "--default-prob"),
        (["office", "--ros1", "--since", "12:00", "--until", "11:00"], 1, "swap them"),
        (["new", "--ros1"], 1, "new: nothing to play: no event in that range"),
        (["nowhere", "--ros1"], 1, "nowhere"),
    ],
)
def test_what_cannot_be_played_is_refused(
    run: Verb, arguments: list[str], code: int, said: str
) -> None:
    """Before ROS is joined, with the way out."""
    done, out, err = run("play", *arguments)

    assert (code, "") == (done, out)
    assert said in " ".join(err.split())


def test_a_person_sees_where_in_the_log_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """
    The log's time, how much of it is over, and how long nothing will come, by the wall's clock;
    drawn in place, and only if it is another.
    """
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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["add", *PLACE], "say which ROS: --ros1 or --ros2"),
        (["add", "--ros1", *PLACE[:-2]], "give --x --y --theta --width, or --from and --to"),
        (["add", "--ros1", *PLACE, "--from", "1,2", "--to", "1,3"], "without --x --y --theta"),
        (["add", "--ros1", *PLACE, "--state", "ajar"], "expected OPEN, CLOSED or UNKNOWN, got"),
        (["update", "1", "--ros2", "--state", "moving"], "messages know no others"),
        (["update", "1", "--ros2"], "nothing to set"),
        (["update", "1", "--ros2", "--prob-open", "1.2"], "--prob-open"),
        (["update", "1", "--ros2", "--x", "nan"], "--x: not a number"),
        (["remove", "-1", "--ros2"], "-1"),
        (["remove", "front", "--ros2"], "ID"),
        (["remove", "1", "--ros2", "--timeout", "nan"], "--timeout"),
        (["save", "--ros2"], "FILE"),
    ],
)
def test_what_cannot_be_called_is_refused(run: Verb, arguments: list[str], said: str) -> None:
    """Before ROS is joined, with exit code 2 and what is missing."""
    done, out, err = run("call", *arguments)

    assert (2, "") == (done, out)
    assert said in " ".join(err.split())


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
