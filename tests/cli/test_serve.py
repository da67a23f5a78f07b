"""`serve` where no ROS is needed: it stops before it joins one, and says why."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.errors import RosError
from semmap_log.live.ros import joining
from tests.live.ros.running import DEADLINE_S
from tests.verbs import Refuses

YAML = "1:\n  position: {x: 1.0, y: 2.0, theta: 0.0}\n  width: 0.5\n  status: OPEN\n"


@pytest.fixture
def office(tmp_path: Path) -> Path:
    sl.create(tmp_path / "office", tz="UTC").close()
    return tmp_path / "office"


def _serve(*options: object) -> tuple[int, str]:
    command = [sys.executable, "-m", "semmap_log", "serve", *map(str, options)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=DEADLINE_S)
    return done.returncode, done.stderr


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """The same within this process: for what is refused before anything is opened."""

    def run(*options: object) -> tuple[int, str]:
        with pytest.raises(SystemExit) as stopped:
            main(["serve", *map(str, options)])
        return int(stopped.value.code or 0), capsys.readouterr().err

    return run


def test_options_that_make_no_sense(office: Path, refuses: Refuses) -> None:
    """Exit code 2, and the log is not touched."""
    refuses(f"""
        serve {office}
        serve {office} --ros1 --ros2
        serve {office} --ros1 --yaml-replace
        serve {office} --ros1 --map map.yaml
        serve {office} --ros1 --by belief
        serve {office} --ros1 --door-inflate 0.5
        serve {office} --ros1 --rooms 2
        serve {office} --ros1 --doors front
        serve {office} --ask unix:doors.sock --plan
        serve {office} --ros1 --costmap --scaling 3
        serve {office} --ros1 --costmap --door-inflate nan
        serve {office} --ros1 --log another
        serve {office} --ros1 --read-only --yaml doors.yaml
        serve {office} --ros1 --save-root nowhere
        serve {office} --ros1 --default-prob nan
        serve {office} --ros1 --default-prob 2
        serve {office} --ros1 --durability maybe
    """)


@pytest.mark.slow
def test_a_log_that_another_process_writes(office: Path) -> None:
    """One line, exit code 1: nobody waits for a lock that a recorder holds all day."""
    with sl.append(office):
        code, said = _serve(office, "--ros1")

    assert 1 == code
    assert said.startswith("semmap-log: ")
    assert "is writing to this log; a log has one writer at a time" in said
    assert 1 == said.count("\n")


@pytest.mark.slow
@pytest.mark.parametrize("options", [("--ros2",), ("--ros1", "--read-only")])
def test_no_log_at_all(tmp_path: Path, options: tuple[str, ...]) -> None:
    """It is not made in passing: a wrong path would begin a second history."""
    code, said = _serve(tmp_path / "nowhere", *options)

    assert (2, 1) == (code, said.count("\n"))
    assert f"nowhere: no such log. To make one: semmap-log init {tmp_path}/nowhere" in said
    assert not (tmp_path / "nowhere").exists()


def test_a_plain_file_of_doors_makes_a_log_and_starts(
    refused: Callable[..., tuple[int, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the thesis's server was started; the second start finds its log."""

    def no_ros(*_: object) -> None:
        raise RosError("no ROS in this test")

    monkeypatch.setattr(joining, "open_node", no_ros)
    file, log = tmp_path / "doors.yaml", tmp_path / "new"
    file.write_text(YAML + "  open_prob: .nan\n  name: front\n  tags: [a]\n")

    first = refused("--ros1", "--yaml", file, "--log", log)
    again = refused("--log", log, "--ros1", "--yaml", file, "_add_door:=doors/add")

    assert [1, 1] == [first[0], again[0]]
    assert f"{log}: a new log; times are in" in first[1]
    assert "doors: 1 added" in first[1]
    assert "left out: " in first[1]
    assert "the key 'tags'" in first[1]
    assert "warning: " in first[1]
    assert "open_prob: expected a number from 0 to 1, got '.nan'; taken for none" in first[1]
    assert "a new log" not in again[1]
    assert "1 door, as in the log" in again[1]
    (door,) = sl.read(log).replay().doors.values()
    assert ("front", 1.0) == (door.name, door.x)


@pytest.mark.parametrize("option", [(), ("--read-only",)])
def test_no_log_is_made_for_a_file_that_cannot_be_read(
    refused: Callable[..., tuple[int, str]], tmp_path: Path, option: tuple[str, ...]
) -> None:
    """Nor by a server that writes nothing."""
    yaml = [] if option else ["--yaml", tmp_path / "missing.yaml"]

    code, said = refused("--ros1", "--log", tmp_path / "new", *yaml, *option)

    assert code != 0
    assert "semmap-log: " in said
    assert [] == list(tmp_path.iterdir())


def test_without_a_log_the_usage_is_told(refused: Callable[..., tuple[int, str]]) -> None:
    code, said = refused("--ros1")

    assert 2 == code
    assert "give the log" in " ".join(said.replace("│", " ").split())


@pytest.mark.slow
def test_a_file_that_differs_stops_the_server(office: Path, tmp_path: Path) -> None:
    """The difference is printed, nothing is written, and the log is free again."""
    with sl.append(office) as log:
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, state="closed")
    file = tmp_path / "doors.yaml"
    file.write_text(YAML)

    code, said = _serve(office, "--ros1", "--yaml", file)

    assert 2 == code
    assert "door 1: width 0.9 in the log, 0.5 in the file, state CLOSED in the log" in said
    with sl.append(office) as log:
        assert 1 == len(list(log.commits()))


@pytest.mark.slow
def test_a_level_that_is_not_there(office: Path) -> None:
    """It is told at the start, before ROS is joined, and not to the first who adds a door."""
    code, said = _serve(office, "--ros1", "--level", "attic")

    assert 2 == code
    assert "no level 'attic'; there are: 0" in said


@pytest.mark.slow
def test_the_interpreter_has_no_ros(office: Path) -> None:
    """What is missing is named, with what to do."""
    if _has_ros("rclpy"):
        pytest.skip("this interpreter has ROS 2")

    code, said = _serve(office, "--ros2")

    assert 1 == code
    assert "ROS 2 is not there for this Python" in said


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_is_told_at_the_start(office: Path, tmp_path: Path) -> None:
    """And not to the first who saves, months later."""
    (tmp_path / "etc").mkdir(mode=0o500)

    _, said = _serve(office, "--ros1", "--save-root", tmp_path / "etc")

    assert "warning: SaveDoorDB cannot save in" in said


def _has_ros(module: str) -> bool:
    from importlib.util import find_spec

    return find_spec(module) is not None
