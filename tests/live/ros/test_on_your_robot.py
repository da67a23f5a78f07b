"""What the page "On your robot" hands out is as it says: services, a policy, commands, links."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tests.live.ros.ros_world import ROOT

FOLDER = ROOT / "semmap_log" / "live" / "robot_files"
PAGE = (FOLDER / "README.md").read_text(encoding="utf-8")
SERVICES = sorted(FOLDER.glob("systemd/*.service"))


@pytest.mark.parametrize("path", SERVICES, ids=lambda path: path.stem)
def test_systemd_finds_nothing_to_say_about_a_service(path: Path, tmp_path: Path) -> None:
    """`systemd-analyze verify` reads every key of the unit, as that of one log."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    unit = tmp_path / path.name.replace("@", "@office")
    shutil.copy(path, unit)

    done = subprocess.run(
        ["systemd-analyze", "verify", unit], capture_output=True, text=True, check=False
    )

    assert (0, "") == (done.returncode, done.stderr)


@pytest.mark.parametrize(
    ("service", "said"),
    [
        ("server", "serve /var/lib/semmap/office --ros2 --costmap"),
        ("recorder", "record /var/lib/semmap/office --ros2"),
    ],
)
def test_a_service_starts_the_verb_with_the_options_of_its_file(
    service: str, said: str, tmp_path: Path
) -> None:
    """
    The unit's command in a real shell: the log's name is the unit's, the ROS that of its setup.
    """
    unit = (FOLDER / "systemd" / f"semmap-{service}@.service").read_text(encoding="utf-8")
    (line,) = re.findall(r"^ExecStart=/bin/bash -c '(.*)'$", unit, flags=re.MULTILINE)
    command = line.replace("%S", "/var/lib").replace("%i", "office").replace("$$", "$")
    (tmp_path / "setup.bash").write_text("export ROS_VERSION=2")
    settings = (FOLDER / "systemd" / "office.env").read_text(encoding="utf-8")
    settings = re.sub("(?m)^ROS_SETUP=.*", f"ROS_SETUP={tmp_path / 'setup.bash'}", settings)
    (tmp_path / "office.env").write_text(settings)

    done = subprocess.run(
        ["bash", "-c", f'set -a; . "$0"; set +a; SEMMAP_LOG=echo; {command}',
         tmp_path / "office.env"],
        env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True, check=True,
    )  # fmt: skip

    assert said == done.stdout.strip()


def test_the_doors_of_the_page_lie_where_a_service_may_write() -> None:
    """`ProtectSystem=strict` leaves a service its state and its logs."""
    settings = (FOLDER / "systemd" / "office.env").read_text(encoding="utf-8")
    unit = (FOLDER / "systemd" / "semmap-server@.service").read_text(encoding="utf-8")
    state = "/var/lib/" + re.findall(r"(?m)^StateDirectory=(.*)$", unit)[0] + "/"

    named = re.findall(r"--(?:yaml|save-root) (/\S+?)[\s\"`]", PAGE + settings)

    assert "ProtectSystem=strict" in unit
    assert "ReadWritePaths" not in unit
    assert len(named) >= 3
    assert [] == [path for path in named if not path.startswith(state)]


@pytest.mark.slow
@pytest.mark.parametrize("path", SERVICES, ids=lambda path: path.stem)
def test_what_does_not_mend_itself_is_not_started_again(path: Path, tmp_path: Path) -> None:
    """The code with which the unit's own verb leaves where there is no log."""
    verb = path.stem.removeprefix("semmap-").removesuffix("@").removesuffix("er")
    verb = {"serv": "serve", "record": "record"}[verb]
    never = re.findall(r"(?m)^RestartPreventExitStatus=(.*)$", path.read_text(encoding="utf-8"))

    done = subprocess.run(
        [sys.executable, "-m", "semmap_log", verb, tmp_path / "nowhere", "--ros2"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip

    assert [str(done.returncode)] == never
    assert "no such log" in done.stderr


RULES = {
    "topics": ("topic", {"publish", "subscribe"}),
    "services": ("service", {"reply", "request"}),
    "actions": ("action", {"call", "execute"}),
}
"""What ros2/design's article on access control policies knows: group -> element, permissions."""


def test_the_policy_says_what_policies_can_say() -> None:
    """Its elements and permissions are those of SROS2's schema; whose tools cannot be had here."""
    policy = ET.parse(FOLDER / "sros2" / "policy.xml").getroot()

    assert "0.2.0" == policy.get("version")
    groups = [group for profile in policy.iter("profile") for group in profile]
    assert groups
    for group in groups:
        element, permissions = RULES[group.tag]
        assert {element} == {child.tag for child in group}
        assert set(group.attrib) <= permissions
        assert {"ALLOW"} == set(group.attrib.values())


def test_the_policy_lets_only_the_operator_call() -> None:
    """Of the actions by their default names; the server alone executes them."""
    from semmap_log.live.ros.ros_node import DEFAULTS

    policy = ET.parse(FOLDER / "sros2" / "policy.xml").getroot()

    allowed = {
        (enclave.get("path"), permission): {action.text for action in actions}
        for enclave in policy.iter("enclave")
        for actions in enclave.iter("actions")
        for permission in actions.attrib
    }
    assert {
        ("/semmap/server", "execute"): set(DEFAULTS.values()),
        ("/semmap/operator", "call"): set(DEFAULTS.values()),
    } == allowed


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`([a-z_0-9]+/[\w.@]*)`", PAGE))))
def test_what_the_page_names_beside_itself_is_there(name: str) -> None:
    """Folders and files that it sends people to."""
    assert (FOLDER / name).exists()


def test_the_page_names_verbs_that_there_are() -> None:
    """Each `semmap-log VERB` of its text and commands."""
    from semmap_log.cli.verb_table import SHOWN

    named = set(re.findall(r"semmap-log ([a-z][a-z-]+)", PAGE))

    assert {"serve", "record", "play", "call", "init", "ros-package"} <= named
    assert [] == sorted(named - SHOWN.keys())


def test_files_in_launch_commands_have_whole_paths() -> None:
    """roslaunch starts nodes in ~/.ros, where nobody keeps them."""
    options = re.findall(r'options:="(.*?)"', PAGE)

    files = [word for each in options for word in each.split() if not word.startswith("-")]
    assert files
    assert [] == [word for word in files if not Path(word).is_absolute()]


def test_services_run_as_they_are_handed_out() -> None:
    """No option of theirs names a file that nobody made."""
    settings = (FOLDER / "systemd" / "office.env").read_text(encoding="utf-8")
    values = dict(re.findall(r"^(\w+)=(.*)$", settings, flags=re.MULTILINE))

    assert '""' == values["RECORD_OPTIONS"]
    assert not values["ROS_SETUP"].startswith(("/home", "/root", "~"))
    assert values["ROS_SETUP"] in PAGE
