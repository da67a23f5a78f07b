"""An interrupt right behind a commit: it is stored, and nobody was told so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorAdded, RobotPose


def _interrupt_behind(log: sl.DoorLogWriter, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Ctrl-C come when the next commit has been stored."""
    writer = log._writer
    append: Callable[..., Any] = writer.append

    def interrupted(*args: Any, **options: Any) -> None:
        monkeypatch.undo()
        append(*args, **options)
        raise KeyboardInterrupt

    monkeypatch.setattr(writer, "append", interrupted)


def test_no_id_is_given_twice(memory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The next door gets the id after that of the one whose adding was interrupted."""
    with sl.create(memory / "log", tz="UTC") as log:
        log.add_door(name="front")
        _interrupt_behind(log, monkeypatch)
        with pytest.raises(KeyboardInterrupt):
            log.add_door(name="back")

        door = log.add_door(name="side")

        assert 3 == door
        assert 2 == log.resolve("back")
        assert [1, 2, 3] == [e.event.door_id for e in log.history(kinds=[DoorAdded])]


@pytest.mark.parametrize("by", ["the next commit", "closing"])
def test_no_pose_is_written_twice(by: str, memory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither one that joined a commit, nor one that waited for none."""
    log = sl.create(memory / "log", tz="UTC")
    log.robot_pose(RobotPose(x=1.0, y=0.0, theta=0.0))
    _interrupt_behind(log, monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        log.add_door() if by == "the next commit" else log.close()
    if by == "the next commit":
        log.robot_pose(RobotPose(x=2.0, y=0.0, theta=0.0))
    log.close()

    history = sl.read(memory / "log").history(kinds=[RobotPose])
    poses = [entry.event.x for entry in history if isinstance(entry.event, RobotPose)]
    assert ([1.0, 2.0] if by == "the next commit" else [1.0]) == poses
