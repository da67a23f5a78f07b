"""A node of a launch file, which is started again whatever its exit code, and would fail again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.live.ros.running import DEADLINE_S

LAUNCH = (
    Path(__file__).parents[2]
    / "semmap_log"
    / "live"
    / "robot_files"
    / "lta_semantic_map"
    / "launch"
)


def start(*arguments: str, respawned: bool) -> subprocess.Popen[str]:
    environment = {**os.environ, **({"SEMMAP_RESPAWNED": "1"} if respawned else {})}
    return subprocess.Popen(
        [sys.executable, "-m", "semmap_log", *arguments],
        env=environment, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("serve", "nowhere", "--ros1"), "nowhere: no such log"),
        (("record", "nowhere", "--ros2"), "nowhere: no such log"),
        (("serve", "nowhere", "--ross1"), "No such option: --ross1"),
    ],
)
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_what_would_fail_again_waits_to_be_stopped(
    arguments: tuple[str, ...], said: str, stop: signal.Signals
) -> None:
    """Told once; the signals by which a launch stops its nodes end it."""
    with start(*arguments, respawned=True) as node:
        assert node.stderr is not None
        lines = []
        while not lines or "it waits" not in lines[-1]:
            lines.append(node.stderr.readline())
            assert lines[-1], lines
        assert any(said in line for line in lines)
        with pytest.raises(subprocess.TimeoutExpired):
            node.wait(timeout=0.2)

        node.send_signal(stop)

        assert -stop == node.wait(timeout=DEADLINE_S)
        assert "" == node.stderr.read()


def test_by_hand_and_under_systemd_it_ends(tmp_path: Path) -> None:
    """With the exit code that the units know."""
    with start("serve", str(tmp_path / "nowhere"), "--ros1", respawned=False) as node:
        assert "it waits" not in node.communicate(timeout=DEADLINE_S)[1]
        assert 2 == node.returncode


def test_what_may_mend_itself_is_started_again(tmp_path: Path) -> None:
    """Exit code 1, as where another process holds the log, ends the node."""
    with start("replay", str(tmp_path / "nowhere"), respawned=True) as node:
        assert "it waits" not in node.communicate(timeout=DEADLINE_S)[1]
        assert 1 == node.returncode


def test_every_launch_file_that_starts_again_says_so_to_its_node() -> None:
    """Those that include one of them have it from there."""
    starting = [path for path in LAUNCH.iterdir() if "respawn" in path.read_text("utf-8")]

    assert 6 == len(starting)
    for path in starting:
        assert 1 == path.read_text("utf-8").count('"SEMMAP_RESPAWNED"'), path.name
