"""`tools/set_up_ros.py` does again only what has changed, and says what it cannot have."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import set_up_ros
from ros_interfaces import legs

LEG = legs.Leg("mine", "/usr/bin/python3", ("no-such-package",), "ros2")


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What of a leg is made, with making itself left out."""
    monkeypatch.setenv("SEMMAP_ROS", str(tmp_path))
    made: list[str] = []
    LEG.folder.mkdir()
    monkeypatch.setattr(set_up_ros, "_make_environment", lambda leg: made.append("environment"))
    monkeypatch.setattr(set_up_ros, "_build_messages", lambda leg: made.append("messages"))
    return made


def test_what_is_there_is_left_alone(made: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """The second time nothing is made, and it says so."""
    set_up_ros._set_up(LEG)
    set_up_ros._set_up(LEG)

    assert ["environment", "messages"] == made
    assert "mine: there already" in capsys.readouterr().out


def test_another_message_is_built_into_the_same_environment(
    made: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A definition that was changed takes the messages alone."""
    set_up_ros._set_up(LEG)
    monkeypatch.setattr(legs.Leg, "packages", [])
    set_up_ros._set_up(LEG)

    assert ["environment", "messages", "messages"] == made


def test_a_failure_is_no_set_up(made: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """What broke off is tried again."""

    def fail(leg: legs.Leg) -> None:
        raise set_up_ros.SetUpError("no compiler")

    with monkeypatch.context() as broken:
        broken.setattr(set_up_ros, "_build_messages", fail)
        with pytest.raises(set_up_ros.SetUpError, match="no compiler"):
            set_up_ros._set_up(LEG)
    set_up_ros._set_up(LEG)

    assert ["environment", "messages"] == made


def test_who_is_not_root_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a command to copy."""
    monkeypatch.setattr(os, "geteuid", lambda: 1000)

    with pytest.raises(set_up_ros.SetUpError, match=r"sudo apt-get install .* no-such-package$"):
        set_up_ros._install_with_apt([LEG])


def test_a_folder_that_is_no_environment_is_not_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """$SEMMAP_ROS may point anywhere."""
    monkeypatch.setenv("SEMMAP_ROS", str(tmp_path))
    LEG.folder.mkdir()

    with pytest.raises(set_up_ros.SetUpError, match="it stays as it is"):
        set_up_ros._make_environment(LEG)

    assert LEG.folder.is_dir()


def test_an_unknown_ros_is_a_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, with those that there are."""
    with pytest.raises(SystemExit, match=r"^2$"):
        set_up_ros.main(["humble"])

    assert "known: ros1, jazzy, kilted" in capsys.readouterr().err
