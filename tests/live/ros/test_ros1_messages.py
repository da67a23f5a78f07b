"""ROS 1's messages are made from the thesis's texts, as catkin makes them."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

from semmap_log.errors import RosError
from semmap_log.live.ros.ros1_messages import action_messages, message_module
from tests.live.ros.ros_world import ROOT, RosWorld

THESIS = ROOT / "semmap_log" / "live" / "robot_files" / "lta_semantic_map"

GENERATE_AND_COMPARE = """
import sys
from pathlib import Path
from semmap_log.live.ros.ros1_messages import generate
generate(Path(sys.argv[1]), into=Path("."))
sys.path.append(".")
import actionlib.msg, theirs.msg
names = [name for name in dir(theirs.msg) if name.startswith("Test")]
md5s = lambda module: [getattr(module, name)._md5sum for name in names]
print(len(names), md5s(theirs.msg) == md5s(actionlib.msg))
"""

MESSAGES = """
from pathlib import Path
from semmap_log.live.ros.ros1_messages import message_module
module = message_module()
print(module.DoorMap._md5sum, module.AddDoorAction._md5sum)
print(Path(module.__file__).exists())
"""


@pytest.fixture
def actionlibs_own(tmp_path: Path) -> Path:
    """The action that actionlib tests itself with; Debian ships the classes made from it."""
    folder = tmp_path / "theirs" / "action"
    folder.mkdir(parents=True)
    (folder / "Test.action").write_text("int32 goal\n---\nint32 result\n---\nint32 feedback\n")
    return folder.parent


def test_an_action_has_the_checksums_of_catkins(ros1: RosWorld, actionlibs_own: Path) -> None:
    """All seven messages of actionlib's own action, against those that Debian built with catkin."""
    said = ros1.code(GENERATE_AND_COMPARE, actionlibs_own).finish()

    assert "7 True" in said


@pytest.mark.parametrize("folder", [None, THESIS.parent], ids=["anywhere", "among the definitions"])
def test_no_build_is_needed(ros1: RosWorld, folder: Path | None) -> None:
    """Debian's own Python has no messages of ours: they are made on the spot, and no file stays."""
    built, is_installed = ros1.python("-c", MESSAGES).finish().splitlines()

    said = ros1.run("/usr/bin/python3", "-c", MESSAGES, cwd=folder).finish()
    made, stays = said.splitlines()

    assert built == made
    assert ("True", "False") == (is_installed, stays)


def test_without_ros_it_says_what_to_install() -> None:
    """In a Python that has neither our messages nor what makes them."""
    if find_spec("genpy") is not None:
        pytest.skip("this Python has ROS 1")

    with pytest.raises(RosError, match=r"ROS 1 is not installed for this Python.*apt-get install"):
        message_module()


REFUSED = """
import sys
from pathlib import Path
from semmap_log.errors import RosError
from semmap_log.live.ros.ros1_messages import generate
try:
    generate(Path(sys.argv[1]), into=Path("."))
except RosError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("strange_msgs/Thing thing\n", "strange_msgs/Thing is not installed for this Python"),
        ("float65 x\n", "broken: genpy refuses a definition; it says above which, and why."),
    ],
    ids=["a package that is not here", "a type that there is not"],
)
def test_a_definition_that_cannot_be_is_refused(
    ros1: RosWorld, tmp_path: Path, text: str, said: str
) -> None:
    """With what is missing, or what genpy says of it."""
    path = tmp_path / "broken" / "msg" / "Broken.msg"
    path.parent.mkdir(parents=True)
    path.write_text(text)

    assert said in ros1.code(REFUSED, tmp_path / "broken").finish()


SERVICE = """
import sys
from pathlib import Path
from semmap_log.live.ros.ros1_messages import generate
generate(Path(sys.argv[1]), into=Path("."))
sys.path.append(".")
from nav_msgs.srv import GetMap
from theirs.srv import GetMap as made
print(made._md5sum == GetMap._md5sum)
"""


def test_a_service_has_the_checksum_of_catkins(ros1: RosWorld, tmp_path: Path) -> None:
    """One with a message of another package, which needs others in turn, against Debian's."""
    path = tmp_path / "theirs" / "srv" / "GetMap.srv"
    path.parent.mkdir(parents=True)
    path.write_text("---\nnav_msgs/OccupancyGrid map\n")

    assert "True" in ros1.code(SERVICE, tmp_path / "theirs").finish()


def test_an_action_of_two_parts_is_refused() -> None:
    """Rather than a message left out."""
    with pytest.raises(RosError, match=r"Half.action: expected goal, result and feedback.*2 parts"):
        action_messages("Half", "int32 goal\n---\nint32 result\n")
