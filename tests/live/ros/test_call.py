"""`call` in a real ROS: the four actions of a server that knows nothing of us."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from tests.live.ros.door_map_listener import Heard, heard, listen
from tests.live.ros.plain_server import plain_server
from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running, wait_until

NAMES = {"add_door": "AddDoor", "update_door": "UpdateDoor", "remove_door": "RemoveDoor",
         "save_door_db": "SaveDoorDB"}  # fmt: skip


class Site:
    """A server, a subscriber, and our client."""

    def __init__(self, world: RosWorld, listener: Running) -> None:
        self.world = world
        self._listener = listener

    def call(self, *arguments: object, in_simulation: bool = False) -> Running:
        """Call, with parameters that say how the servers are called there; return when over."""
        sim_time = ["-p", "use_sim_time:=true"] if in_simulation else []
        if self.world.version == 1:
            names = [f"_{name}:=plain/{action}" for name, action in NAMES.items()]
        else:
            names = ["--ros-args", *sim_time]
            for name, action in NAMES.items():
                names += ["-p", f"{name}:=plain/{action}"]
        patience = () if "--timeout" in arguments else ("--timeout", 60)
        client = self.world.semmap("call", *arguments, *patience, self.world.option, *names)
        client.wait()
        return client

    def wait_for_doors(self, *doors: list[object]) -> None:
        """Wait until the last door map that was heard has these entries."""
        wait_until(lambda: [each.doors for each in self.heard()][-1:] == [str(list(doors))],
                   f"{doors}, not {self.heard()[-1:]}")  # fmt: skip

    def heard(self) -> list[Heard]:
        return heard(self._listener)


@pytest.fixture(scope="module")
def site(ros: RosWorld) -> Iterator[Site]:
    """Somebody's server, whose doors stay from test to test."""
    with plain_server(ros), listen(ros) as listener:
        yield Site(ros, listener)


def test_a_door_is_added_changed_and_removed(site: Site) -> None:
    """Each call prints what was done, and changes what it names alone."""
    added = site.call("add", "--from", "1,2", "--to", "1,3", "--state", "closed",
                      "--prob-open", "0.25", "--prob-closed", "0.75")  # fmt: skip
    number = int(added.output)
    half_pi = 1.5707963267948966
    site.wait_for_doors([number, 1.0, 2.0, half_pi, 1.0, "CLOSED", 0.25, 0.75])

    opened = site.call("update", number, "--state", "open", "--prob-open", "0.5")
    site.wait_for_doors([number, 1.0, 2.0, half_pi, 1.0, "OPEN", 0.5, 0.75])
    moved = site.call("update", number, "--x", "-4", "--width", "0.5")
    site.wait_for_doors([number, -4.0, 2.0, half_pi, 0.5, "OPEN", 0.5, 0.75])
    removed = site.call("remove", number)
    site.wait_for_doors()

    assert [f"door {number} updated\n"] * 2 == [opened.output, moved.output]
    assert f"door {number} removed\n" == removed.output
    assert [0] * 4 == [each.process.returncode for each in (added, opened, moved, removed)]


def test_json_has_status_result_and_text(site: Site) -> None:
    """Of what was done, exit code 0, as of what was not, exit code 1."""
    saved = site.call("save", "doors.yaml", "--json")
    refused = site.call("remove", 4_000_000_000, "--json")

    text = "no such door" if site.world.version == 1 else ""  # results of ROS 2 have none
    assert {"status": "SUCCEEDED", "result": {"stored_successful": True}, "text": ""} == (
        json.loads(saved.output)
    )
    assert {"status": "ABORTED", "result": {"door_removed": False}, "text": text} == (
        json.loads(refused.output)
    )
    assert (0, 1) == (saved.process.returncode, refused.process.returncode)


def test_what_cannot_be_is_told(site: Site) -> None:
    """A door that is not there, to be moved in part."""
    strange = site.call("update", 77, "--x", "1")
    nobody = site.call("remove", "1", "--server", "/nobody/remove", "--timeout", "0.5")
    vague = site.call("add", "--from", "1,2", "--to", "1,3")

    assert [1] * 3 == [each.process.returncode for each in (strange, nobody, vague)]
    assert "AddDoor is not semmap-log's" in vague.errors  # it would keep a NaN
    assert "expected --prob-open and --prob-closed, got none" in vague.errors
    assert "door 77: expected a door of" in strange.errors
    assert "no action server /nobody/remove answered within 0.5 s" in nobody.errors


def test_a_simulation_that_stands_still_delays_nothing(site: Site) -> None:
    """Where ROS's time does not go on, neither a server that is there is waited for."""
    set_time = site.world.version == 1
    if set_time:  # ROS 1: all nodes'; ROS 2: each node's own
        site.world.tool("rosparam", "set", "/use_sim_time", "true").finish()
    try:
        served = site.call("update", 77, "--state", "open", in_simulation=True)
        nobody = site.call("remove", 1, "--server", "/nobody/remove", "--timeout", "0.5",
                           in_simulation=True)  # fmt: skip
    finally:
        if set_time:
            site.world.tool("rosparam", "delete", "/use_sim_time").finish()

    assert "update of door 77: ABORTED" in served.errors
    assert "no action server /nobody/remove answered within 0.5 s" in nobody.errors
