"""What on the command line is ROS's, and what is ours."""

from __future__ import annotations

import pytest

from semmap_log.cli import main
from semmap_log.cli.ros import split_ros_args


@pytest.mark.parametrize(
    ("given", "ours", "ros"),
    [
        (["serve", "log", "--ros1"], ["serve", "log", "--ros1"], []),
        (
            ["serve", "log", "__name:=doors", "--ros1", "/a:=/b", "_rate:=2"],
            ["serve", "log", "--ros1"],
            ["__name:=doors", "/a:=/b", "_rate:=2"],
        ),
        (
            ["play", "log", "--ros-args", "-r", "__ns:=/r1", "-p", "x:=1", "--", "--ros2"],
            ["play", "log", "--ros2"],
            ["--ros-args", "-r", "__ns:=/r1", "-p", "x:=1", "--"],
        ),
        (["record", "log", "--ros2", "--ros-args"], ["record", "log", "--ros2"], ["--ros-args"]),
        (["annotate", "log", "1", "note", "a:=b"], ["annotate", "log", "1", "note", "a:=b"], []),
        (["--version"], ["--version"], []),
    ],
)
def test_what_belongs_to_ros_is_taken_out(
    given: list[str], ours: list[str], ros: list[str]
) -> None:
    """Remappings and what follows --ros-args are ROS's, in the verbs that join it and no others."""
    split = split_ros_args(given)

    assert (ours, ros) == split


@pytest.mark.parametrize(
    "verb", ["serve", "record", "play", "call", "call add", "call update", "call save"]
)
def test_help_fits_a_robots_terminal(
    verb: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """80 columns: examples and tables, which are printed as they stand, too."""
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit, match=r"^0$"):
        main([*verb.split(), "--help"])

    lines = capsys.readouterr().out.splitlines()

    assert "Usage: " in lines[0]
    assert [] == [line for line in lines if len(line) > 80]
