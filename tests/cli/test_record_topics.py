"""`record --ros1`, `--ros2`: what is refused before any ROS is asked."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from tests.verbs import Refuses, run


@pytest.fixture
def office(tmp_path: Path) -> Path:
    sl.create(tmp_path / "office", tz="UTC").close()
    return tmp_path / "office"


def test_options_that_do_not_belong_together_are_a_usage_error(
    office: Path, refuses: Refuses
) -> None:
    """And nothing is read or joined."""
    refuses(f"""
        record {office} --ros1 --ros2
        record {office} --mapping m.yaml
        record {office} --dry-run
        record {office} --level L1
        record {office} --heights 0.3,1.5
        record {office} --ros1 --heights 0.3,1.5
        record {office} --ros1 --scan --heights 0.3
        record {office} /map:=/floor
        record {office} --ros1 --ack
        record {office} --ros2 --strict
    """)


def test_a_wrong_mapping_is_told_before_ros_is_joined(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With its line: whoever writes one need not have the robot at hand."""
    (tmp_path / "m.yaml").write_text("topics:\n  /a: dor_map\n")

    assert 2 == run("record", office, "--ros2", "--mapping", tmp_path / "m.yaml")

    assert "m.yaml:2: /a: read: expected one of door_map," in capsys.readouterr().err


@pytest.mark.parametrize("dry_run", [[], ["--dry-run"]])
def test_a_level_that_is_not_there_is_told_before_ros_is_joined(
    dry_run: list[str], office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A recorder that leaves out every topic is none."""
    assert 2 == run("record", office, "--ros2", "--scan", "--level", "attic", *dry_run)

    assert "attic" in capsys.readouterr().err


def test_a_log_that_is_written_by_another_is_told_before_ros_is_joined(
    office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As by every verb that writes."""
    with sl.append(office):
        assert 1 == run("record", office, "--ros1")

    assert "is writing to this log" in capsys.readouterr().err


def test_no_log_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2: a service that is started again would never find it either."""
    assert 2 == run("record", tmp_path / "nowhere", "--ros1")

    said = capsys.readouterr().err
    assert said.startswith(f"semmap-log: {tmp_path}/nowhere: no such log. To make one: ")
