"""The sample clients of the docs, run as they stand against our server."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorAdded, DoorUpdated
from tests.live.ros.ros_world import ROOT, RosWorld

PATIENT_CALL = """
from semmap_log.cli import main
from semmap_log.live.ros import client
client.REASON_WITHIN_S = 100
main()
"""

SAMPLES = ROOT / "semmap_log" / "live" / "robot_files" / "samples"


@pytest.fixture(scope="module")
def served(ros: RosWorld, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A log that is served."""
    log = tmp_path_factory.mktemp("samples") / "log"
    sl.create(log, tz="UTC").close()
    with ros.semmap("serve", log, ros.option) as server:
        server.wait_for("serves")
        yield log


def test_the_sample_client_does_what_its_docstring_says(ros: RosWorld, served: Path) -> None:
    """It knows the ROS package alone; what it did is in the log, and who it was."""
    sample = SAMPLES / f"ros{ros.version}_client.py"
    assert "semmap_log" not in sample.read_text()

    said = ros.python(sample, environment={"PYTHONPATH": ""}).finish()

    assert "door 1 is OPEN\n" == said
    added, updated = (entry for entry in sl.read(served).history() if entry.door_id == 1)
    assert isinstance(added.event, DoorAdded)
    assert isinstance(updated.event, DoorUpdated)
    assert added.actor == updated.actor
    assert added.actor.startswith("/sample_door_client")


def test_call_adds_a_door_without_probabilities(ros: RosWorld, served: Path) -> None:
    """Our server is known by what it publishes: a probability that is not given is none there."""
    words = ("add", "--from", "1,2", "--to", "1,3", "--timeout", 60)

    door = sl.DoorId(int(ros.semmap("call", *words, ros.option).finish()))

    added = sl.read(served).replay().doors[door]
    assert (True, True) == (math.isnan(added.prob_open), math.isnan(added.prob_closed))


def test_call_says_why_a_goal_was_aborted(ros: RosWorld, served: Path) -> None:
    """
    In ROS 1 the result has a text; in ROS 2 the server says it on /rosout, with the goal's id.
    """
    refused = ros.code(PATIENT_CALL, "call", "remove", 77, "--timeout", 60, ros.option)

    assert 1 == refused.wait()
    assert "removal of door 77: ABORTED: " in refused.errors
    assert "77" in refused.errors.partition("ABORTED: ")[2]
    assert served.exists()
