"""The recordings that ship: what a replay of them gives, and what is in them."""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

import semmap_log as sl
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import KINDS, DoorObserved, RobotPose
from semmap_log.core.model.moments import format_utc
from semmap_log.store.byte_layout import KINDS_OF_MINOR

ROOT = Path(__file__).resolve().parent.parent
RECORDINGS = ROOT / "recordings"
README = RECORDINGS / "README.md"
NAMES = ("office", "clinic_week")


def expected(name: str) -> list[dict[str, Any]]:
    return json.loads((RECORDINGS / f"{name}.expected.json").read_text())


def number(value: float) -> float | None:
    return None if math.isnan(value) else value


def as_json(door: Door) -> dict[str, Any]:
    return {
        "door_id": door.door_id,
        "name": door.name,
        "level": door.level,
        "x": door.x,
        "y": door.y,
        "theta": door.theta,
        "width": door.width,
        "state": door.state.name,
        "prob_open": number(door.prob_open),
        "prob_closed": number(door.prob_closed),
        "last_seen": None if door.last_seen_ns is None else format_utc(door.last_seen_ns),
    }


@pytest.mark.parametrize(
    ("name", "moment"),
    [
        pytest.param(name, moment, id=f"{name}: {moment['about']}")
        for name in NAMES
        for moment in expected(name)
    ],
)
def test_replay_gives_the_expected_state(name: str, moment: dict[str, Any]) -> None:
    """At every moment that ships, a replay gives the doors that the tool folded by hand."""
    log = sl.read(RECORDINGS / name)

    state = log.replay(at=moment["at"], known_at=moment["known_at"], event=moment["event"])

    assert moment["doors"] == [as_json(door) for door in state.doors.values()]


def test_moments_tell_states_apart() -> None:
    """The moments are worth asking for: no two of a recording have the same doors."""
    for name in NAMES:
        states = [json.dumps(moment["doors"]) for moment in expected(name)]

        assert len(states) == len(set(states))


def kinds_in(name: str) -> Counter[str]:
    counts: Counter[str] = Counter()
    for batch in sl.read(RECORDINGS / name).batches(retracted=True):
        numbers, times = np.unique(batch.kind, return_counts=True)
        for kind, count in zip(numbers.tolist(), times.tolist(), strict=True):
            counts[KINDS[kind - 1].__name__] += count
    return counts


def test_office_is_small_and_has_one_of_everything() -> None:
    """The office can be checked by hand, and shows each kind of event of its format's version."""
    counts = kinds_in("office")

    assert sum(counts.values()) < 300
    assert f"{sum(counts.values())} / 41" in README.read_text()
    there = {kind.__name__ for kind in KINDS[: KINDS_OF_MINOR[0]]}
    assert set(counts) == there - {"DoorRemoved", "LogExported"}


def test_clinic_week_holds_what_readme_says() -> None:
    """The clinic's events, kind by kind; when they change, the README changes, too."""
    counts = kinds_in("clinic_week")

    assert sum(counts.values()) >= 50_000
    assert counts == CLINIC_WEEK
    for told in ("DoorObserved", "RobotPose"):
        assert f"{counts[told]:,}" in README.read_text()


CLINIC_WEEK = {
    "DoorAdded": 133,
    "DoorUpdated": 52,
    "DoorRemoved": 1,
    "DoorObserved": 18_364,
    "DoorRequested": 280,
    "DoorPassed": 918,
    "PatrolStarted": 104,
    "PatrolFinished": 104,
    "RobotPose": 56_936,
    "Retracted": 2,
    "DoorAnnotated": 267,
    "LevelAdded": 2,
    "FloorMap": 2,
}


@pytest.mark.parametrize(("name", "most_bytes"), [("office", 110_000), ("clinic_week", 6_000_000)])
def test_size(name: str, most_bytes: int) -> None:
    """Recordings stay small enough for a repository."""
    assert sum(path.stat().st_size for path in (RECORDINGS / name).iterdir()) <= most_bytes


def test_clinic_sensor_has_two_accuracies() -> None:
    """A sighting says how often its sensor reads open and closed doors right."""
    log = sl.read(RECORDINGS / "clinic_week")

    seen = [batch[DoorObserved] for batch in log.batches(kinds=[DoorObserved])]

    assert {0.97} == {value for rows in seen for value in rows["accuracy_open"].tolist()}
    assert {0.95} == {value for rows in seen for value in rows["accuracy_closed"].tolist()}


@pytest.mark.parametrize(("name", "levels"), [("office", (1,)), ("clinic_week", (1, 2))])
def test_robot_drives_on_free_floor(name: str, levels: tuple[int, ...]) -> None:
    """Every pose, and the straight line to the next one on the same level, lies on free floor."""
    log = sl.read(RECORDINGS / name)
    poses = np.concatenate([batch[RobotPose] for batch in log.batches(kinds=[RobotPose])])

    for level in levels:
        floor = log.floor_map(level)
        assert floor is not None
        on = poses["level"] == level
        points = np.stack([poses["x"], poses["y"]], -1)
        pairs = np.flatnonzero(on[:-1] & on[1:])
        for share in np.linspace(0, 1, 41):
            way = points[pairs] * (1 - share) + points[pairs + 1] * share
            columns, rows = (
                ((way - (floor.origin_x, floor.origin_y)) // floor.resolution).astype(int).T
            )

            assert set(np.unique(floor.cells[rows, columns]).tolist()) == {0}


@pytest.mark.parametrize("name", NAMES)
def test_licence_of_the_plans_is_told(name: str) -> None:
    """The plans' licence lies beside; the README names their source and commit."""
    licence = (RECORDINGS / "LICENSE.rmf_demos").read_text()
    readme = README.read_text()

    assert "Apache License" in licence
    assert "open-rmf/rmf_demos" in readme
    assert "e1af33e0" in readme
    assert name in readme


def messages(segment: Path) -> list[tuple[str, int, int, int, bytes]]:
    with segment.open("rb") as stream:
        return [
            (channel.topic, message.sequence, message.log_time, message.publish_time, message.data)
            for _, channel, message in make_reader(stream).iter_messages()
        ]


def test_scans_are_what_readme_says() -> None:
    """Counts, doors and passages that the README tells; small enough for a repository."""
    bag = RECORDINGS / "office_scans.mcap"
    truth = json.loads((RECORDINGS / "office_scans.truth.json").read_text())
    scans = Counter(topic for topic, *_ in messages(bag))["/scan"]
    hardware = next(door for door in truth["doors"] if door["name"] == "hardware_door")
    readme = README.read_text()

    assert f"{scans:,} scans of 180 beams" in readme
    assert len(hardware["driven_through_s"]) == 4
    assert not any(door["glass"] for door in truth["doors"])
    assert {"OPEN", "CLOSED", "AJAR"} <= {
        row["state"] for door in truth["doors"] for row in door["states"]
    }
    assert bag.stat().st_size <= 1_000_000
