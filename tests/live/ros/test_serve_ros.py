"""`serve` on a real ROS, with clients of that ROS that know nothing of us."""

from __future__ import annotations

import math
import signal
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.events import (
    DoorAdded,
    DoorPassed,
    PatrolFinished,
    PatrolStarted,
    RobotPose,
)
from semmap_log.core.model.moments import SECOND_NS, parse_instant
from tests.analysis.planning.ward import LAB, ward
from tests.conftest import SteadyClock
from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running
from tests.live.ros.serving.goals import DOOR
from tests.live.ros.stock_client import DB, PLAN, StockClient

YAML = """\
1:
  position:
    x: 1.0
    y: 2.0
    theta: 0.0
  width: 0.5
  status: OPEN
  closed_prob: 0.25
  open_prob: 0.75
"""
SERVE = """
from semmap_log.cli import main
from semmap_log.live.ros import ros2, ros2_topics

ros2.RESULT_KEPT_S = 600
ros2_topics.KNOWN_WITHIN_S = 100
main()
"""
"""`serve`, but that on a busy machine, too, ROS 2 knows what was done before, and who asked."""
FIRST = [1, "OPEN", 1.0, 0.5, 0.75]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    sl.create(tmp_path / "log", tz="UTC").close()
    (tmp_path / "doors.yaml").write_text(YAML)
    return tmp_path / "log"


def _serve(ros: RosWorld, path: Path, *options: object) -> Running:
    server = ros.code(SERVE, "serve", path, ros.option, *options)
    server.wait_for("serves")
    return server


def _in_namespace(ros: RosWorld, name: str, **parameters: str) -> list[str]:
    if ros.version == 1:
        return [f"__ns:=/{name}", *(f"_{key}:={value}" for key, value in parameters.items())]
    given = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
    return ["--ros-args", "-r", f"__ns:=/{name}", *given]


def _told(answer: dict[str, Any]) -> tuple[Any, Any]:
    (value,) = answer["result"].values()
    return answer["status"], value


def test_a_day_of_the_server(every_ros: RosWorld, path: Path) -> None:
    """
    Filled from its file; each field alone, bad goals, a watcher that only reads, a late subscriber;
    a goal that is sent again, at once and to the server that is started again, is answered as
    before; another with its id is not.
    """
    ros, file = every_ros, path.parent / "doors.yaml"
    with (
        _serve(ros, path, "--yaml", file, "--costmap") as server,
        _serve(
            ros,
            path,
            "--read-only",
            *_in_namespace(ros, "watcher", add_door="doors/add"),
        ),
        StockClient(ros, "client") as client,
    ):
        client.wait(DB, [FIRST])
        added = client.goal("AddDoor", f"{1:032x}", **DOOR)
        repeated = client.goal("AddDoor", f"{1:032x}", **DOOR)
        other = client.goal("AddDoor", f"{1:032x}", **DOOR | {"width": 0.4})
        client.wait(DB, [FIRST, [2, "CLOSED", 2.0, 0.9, 0.3]])
        client.wait("/semmap/doors", 5)
        client.wait("/semmap/costmap", 18)
        changes = [
            ("change_pos", {"pos_x": 4.0}, [2, "CLOSED", 4.0, 0.9, 0.3]),
            ("change_width", {"width": 0.6}, [2, "CLOSED", 4.0, 0.6, 0.3]),
            ("change_prob_open", {"prob_open": 0.5}, [2, "CLOSED", 4.0, 0.6, 0.5]),
            ("change_prob_closed", {"prob_closed": 0.5}, [2, "CLOSED", 4.0, 0.6, 0.5]),
            ("change_open", {"door_state": "OPEN"}, [2, "OPEN", 4.0, 0.6, 0.5]),
        ]
        for i, (flag, values, shown) in enumerate(changes):
            done = client.goal("UpdateDoor", f"{10 + i:032x}", door_id=2, **{flag: True}, **values)
            assert ("SUCCEEDED", True) == _told(done)
            client.wait(DB, [FIRST, shown])
        client.wait("progress of UpdateDoor", [f"{14:032x}", 100.0])
        client.wait("/semmap/costmap", 0)

        bad = [
            client.goal("AddDoor", **DOOR | {"pos_x": math.nan}),
            client.goal("AddDoor", **DOOR | {"width": -1.0}),
            client.goal("UpdateDoor", door_id=2**32 + 2, change_open=True),
            client.goal("UpdateDoor", door_id=2, change_prob_open=True, prob_open=1.2),
            client.goal("RemoveDoor", door_id=77),
            client.goal("SaveDoorDB", file_name="/etc/doors.yaml"),
            client.goal("AddDoor", name="/watcher/doors/add", **DOOR),
        ]
        saved = client.goal("SaveDoorDB", file_name=f"{path.parent}/saved.yaml")
        with StockClient(ros, "late", "/watcher") as late:
            late.wait(DB, [FIRST, [2, "OPEN", 4.0, 0.6, 0.5]])
        removed = client.goal("RemoveDoor", f"{2:032x}", door_id=2)
        client.wait(DB, [FIRST])
        assert 0 == server.stop(signal.SIGTERM), str(server)

    assert ("SUCCEEDED", 2) == _told(added) == _told(repeated)
    assert ("ABORTED" if ros.version == 1 else "REJECTED") == other["status"]
    assert [("ABORTED", 0)] * 2 + [("ABORTED", False)] * 4 + [("ABORTED", 0)] == [
        _told(one) for one in bad
    ]
    why = "width: expected a finite number of metres, 0 or more, got -1"
    assert ros.version == 2 or why in bad[1]["text"]
    assert why in server.errors + server.output  # whoever runs the server sees it, too
    assert ("SUCCEEDED", True) == _told(saved) == _told(removed)
    assert "open_prob: 0.75" in (path.parent / "saved.yaml").read_text()
    commit = next(c for c in sl.read(path).commits() if c.note.source == "action RemoveDoor")
    assert "/client" == commit.note.actor

    with (
        _serve(ros, path, "--yaml", file) as server,
        StockClient(ros, "client") as client,
    ):
        again = [
            client.goal("AddDoor", f"{1:032x}", **DOOR),
            client.goal("RemoveDoor", f"{2:032x}", door_id=2),
            client.goal("AddDoor", **DOOR),
        ]
        assert 0 == server.stop(signal.SIGINT), str(server)

    assert [("SUCCEEDED", 2), ("SUCCEEDED", True), ("SUCCEEDED", 3)] == [_told(a) for a in again]
    assert [1, 3] == list(sl.read(path).replay().doors)


def test_a_patrol_under_way(ros: RosWorld, tmp_path: Path) -> None:
    """
    The stops that are left, latched: after what a recorder writes, to a late subscriber, to one of
    a server that was started again; none when the round is over.
    """
    path = ward(tmp_path / "ward").path
    lab, front = [8.45, 1.95], [0.95, 1.95]
    clock = SteadyClock(parse_instant("2026-03-23T10:00", tz="Europe/Vienna"))
    options = ("--read-only", "--plan", "--rooms", "lab,2")
    with sl.append(path, clock=clock) as log:
        log.append([RobotPose(level=1, x=5.0, y=1.0, theta=0.0), PatrolStarted(patrol=1)])
        with _serve(ros, path, *options) as server, StockClient(ros, "client") as client:
            client.wait(PLAN, ["map", lab, front])
            clock.now_ns += 10 * SECOND_NS
            log.append([DoorPassed(door_id=LAB, passed=True)])
            client.wait(PLAN, ["map", front])
            with StockClient(ros, "late") as late:
                late.wait(PLAN, ["map", front])
            assert 0 == server.stop(signal.SIGINT), str(server)
        with _serve(ros, path, *options) as server, StockClient(ros, "client") as client:
            client.wait(PLAN, ["map", front])
            clock.now_ns += 10 * SECOND_NS
            log.append([PatrolFinished(patrol=1)])
            client.wait(PLAN, ["map"])
            assert 0 == server.stop(signal.SIGINT), str(server)


def test_a_database_of_the_thesis_that_counts_from_0(ros: RosWorld, path: Path) -> None:
    """Its door 0 is updated, saved and removed as any; a door without a probability is saved."""
    file = path.parent / "doors.yaml"
    partial = YAML.replace("  closed_prob: 0.25\n", "")
    file.write_text(partial.replace("1:\n", "0:\n", 1) + partial)
    zero, one = [0, "OPEN", 1.0, 0.5, 0.75], FIRST

    with _serve(ros, path, "--yaml", file) as server, StockClient(ros, "client") as client:
        client.wait(DB, [zero, one])
        saved = [client.goal("SaveDoorDB", file_name=f"{path.parent}/saved.yaml")]
        done = [
            client.goal("UpdateDoor", door_id=0, change_open=True, door_state="CLOSED"),
            client.goal("RemoveDoor", door_id=1),
        ]
        client.wait(DB, [[0, "CLOSED", 1.0, 0.5, 0.75]])
        gone = client.goal("UpdateDoor", door_id=1, change_open=True, door_state="OPEN")
        done.append(client.goal("RemoveDoor", door_id=0))
        client.wait(DB, [])
        added = client.goal("AddDoor", **DOOR)
        assert 0 == server.stop(signal.SIGINT), str(server)
        said = [server.errors + server.output]

    with (
        _serve(ros, path, "--yaml", file, "--yaml-replace") as server,
        StockClient(ros, "client") as client,
    ):
        client.wait(DB, [zero, one])
        assert 0 == server.stop(signal.SIGINT), str(server)
        said.append(server.errors)

    with _serve(ros, path) as server, StockClient(ros, "client") as client:
        saved.append(client.goal("SaveDoorDB", file_name="doors.yaml"))
        assert 0 == server.stop(signal.SIGINT), str(server)
        said.append(server.errors)

    assert [("SUCCEEDED", True)] * 5 == [_told(answer) for answer in saved + done]
    assert ("ABORTED", False) == _told(gone)
    assert ("SUCCEEDED", 2) == _told(added)
    assert file.read_text() == (path.parent / "saved.yaml").read_text()
    assert file.read_text() == (path.parent / "log_saved" / "doors.yaml").read_text()
    assert f"SaveDoorDB saves in {path.parent}." in said[0]
    why = saved[0]["text"] if ros.version == 1 else said[0]
    assert "closed_prob is not given: door 0, door 1" in why
    why = gone["text"] if ros.version == 1 else said[0]
    assert "door 1 was removed; ids are never used twice. To bring it back" in why
    assert "door 1: its removal, event 4, is taken back" in said[1]
    assert f"SaveDoorDB saves in {path.parent}/log_saved." in said[2]


GOALS = 25


@pytest.mark.slow
@pytest.mark.parametrize("leg", ["ros1", "jazzy"])
def test_a_server_that_is_killed_loses_no_result(
    request: pytest.FixtureRequest, leg: str, path: Path
) -> None:
    """Two clients at once, a power cut in the middle."""
    ros: RosWorld = request.getfixturevalue(leg)
    asks = [[_asked(which, i) for i in range(GOALS)] for which in range(2)]
    told: dict[str, int] = {}
    with (
        _serve(ros, path) as server,
        StockClient(ros, "one") as one,
        StockClient(ros, "other") as other,
    ):
        pair = (one, other)
        for client, its_asks in zip(pair, asks, strict=True):
            for ask in its_asks:
                client.send("goal", **ask)
        for i in range(GOALS // 2):
            for client, its_asks in zip(pair, asks, strict=True):
                answer = client.answer()
                assert "result" in answer, f"{i}: {answer} of {client.running}\n{server}"
                told[its_asks[i]["goal_id"]] = answer["result"]["door_id"]
        server.kill()

    in_log = _ids_by_goal(path)
    assert told.items() <= in_log.items()

    with _serve(ros, path), StockClient(ros, "third") as client:
        known = [[door, "CLOSED", 2.0, 0.9, 0.3] for door in sorted(in_log.values())]
        client.wait(DB, known)  # that of the new server: ROS 2 knows the dead one for a while
        again = {ask["goal_id"]: _insist(client, ask) for ask in chain(*asks)}

    assert in_log.items() <= again.items()
    assert list(range(1, 2 * GOALS + 1)) == sorted(again.values())
    assert again == _ids_by_goal(path)


def _asked(which: int, number: int) -> dict[str, Any]:
    return {
        "name": "/lta_semantic_map/add_door",
        "action": "AddDoor",
        "values": DOOR,
        "goal_id": f"{which + 1}{number:031x}",
    }


def _insist(client: StockClient, ask: dict[str, Any]) -> int:
    """Send a goal until somebody answers: a server that was killed may be taken for alive."""
    for _ in range(20):
        answer = client.ask("goal", **ask, within=4)
        if "result" in answer:
            return int(answer["result"]["door_id"])
    raise AssertionError(f"no answer to {ask}: {client.running}")


def _ids_by_goal(path: Path) -> dict[str, int]:
    log = sl.read(path)
    events = ((c.note.correlation, log.event(c.first_event).event) for c in log.commits())
    return {said: int(event.door_id) for said, event in events if isinstance(event, DoorAdded)}


def test_a_full_disk_aborts_goals_until_there_is_room(ros1: RosWorld, path: Path) -> None:
    """The server stays alive, and goes on as soon as somebody makes room."""
    disk = path.parent / "disk"
    disk.mkdir()
    if not _may_mount(ros1):
        pytest.skip("only root can mount a small disk")
    script = (
        f"mount -t tmpfs -o size=256k tmpfs {disk} && cp -r {path} {disk}/log && "
        f"exec {ros1.interpreter} -m semmap_log serve {disk}/log --ros1"
    )
    with ros1.run("unshare", "-m", "sh", "-c", script) as server, StockClient(ros1, "c") as client:
        server.wait_for("serves")
        added = client.goal("AddDoor", f"{1:032x}", **DOOR)
        _inside(ros1, server, f"dd if=/dev/zero of={disk}/filler bs=1k count=300; true")
        full = []
        for i in range(40):  # the last page of the file may have room for some
            full.append(client.goal("AddDoor", f"{100 + i:032x}", **DOOR))
            if full[-1]["status"] != "SUCCEEDED":
                break
        still_full = client.goal("RemoveDoor", f"{2:032x}", door_id=1)
        _inside(ros1, server, f"rm {disk}/filler")
        again = client.goal("RemoveDoor", f"{2:032x}0", door_id=1)
        _inside(ros1, server, f"cp -r {disk}/log {path.parent}/copy")
        assert 0 == server.stop(signal.SIGTERM), str(server)

    assert ("SUCCEEDED", 1) == _told(added)
    assert ("ABORTED", 0) == _told(full[-1])
    assert "the log could not be written" in full[-1]["text"]
    assert "No space left on device" in full[-1]["text"]
    assert ("ABORTED", False) == _told(still_full)
    assert ("SUCCEEDED", True) == _told(again)
    stored = {int(door) for door in sl.read(path.parent / "copy").replay().doors}
    told = {one["result"]["door_id"] for one in full[:-1]}
    assert told <= stored  # and perhaps the one of which it was not known
    assert len(stored) - len(told) <= 1
    assert "Whether this goal is stored is not known" in full[-1]["text"]


def _inside(ros: RosWorld, server: Running, command: str) -> None:
    """Run a command where the server's disk is."""
    ros.run("nsenter", "-t", server.process.pid, "-m", "sh", "-c", command).finish()


def _may_mount(ros: RosWorld) -> bool:
    return ros.run("unshare", "-m", "mount", "-t", "tmpfs", "tmpfs", "/mnt").wait() == 0
