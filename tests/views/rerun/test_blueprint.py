"""What the viewer is told to show, read back from the recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, LevelAdded, RobotPose
from semmap_log.views.rerun.recording import save_rrd
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START, room, small_log

pytestmark = pytest.mark.viewer


def views_of(log: sl.DoorLog, tmp_path: Path, **how: Any) -> list[str]:
    """Names of the views, in the order in which they were made."""
    import rerun as rr

    save_rrd(log, tmp_path / "x.rrd", **how)
    reader = rr.chunk.RrdReader(tmp_path / "x.rrd")
    (store,) = reader.blueprints()
    names = []
    for chunk in reader.stream(store=store):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:display_name" in batch.schema.names:
            names += [name for (name,) in batch.column("ViewBlueprint:display_name").to_pylist()]
    return sorted(names)


def test_a_building_of_one_level(tmp_path: Path) -> None:
    """Plan, costmap, curves of the door that has probabilities, lanes, text."""
    log = small_log(tmp_path / "log")

    names = views_of(log, tmp_path)

    assert [
        "Costmap", "Door states (UTC)", "Event log (UTC)", "Floor plan", "Rounds (UTC)",
        "front (UTC)",
    ] == names  # fmt: skip


def test_the_costmap_can_be_left_out(tmp_path: Path) -> None:
    """Then it has no tab."""
    log = small_log(tmp_path / "log")

    assert "Costmap" not in views_of(log, tmp_path, costmap=False)


def test_each_level_has_its_plan(tmp_path: Path) -> None:
    """Named as the level is; one without anything on it is left out."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([LevelAdded(level=n, name=name) for n, name in enumerate("ABC", start=1)])
        log.append([room(1)])
        log.append([DoorAdded(door_id=DoorId(1), level=2, x=0, y=0, theta=0, width=1)])

    assert ["A", "B", "B costmap", "Door states (UTC)", "Event log (UTC)"] == views_of(
        sl.read(tmp_path / "log"), tmp_path
    )


def test_sensors_without_a_place_need_no_plan(tmp_path: Path) -> None:
    """Nor curves, where nobody gave probabilities."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=DoorId(1))])

    assert ["Door states (UTC)", "Event log (UTC)"] == views_of(sl.read(tmp_path / "log"), tmp_path)


def test_the_liveliest_doors_stand_before_all_of_them(tmp_path: Path) -> None:
    """Of 20 doors 16 lanes fit the screen: those that change; curves go to the 8 liveliest."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([DoorAdded(door_id=DoorId(n), prob_open=0.5) for n in range(1, 21)])
        for turn in range(20):
            clock.now_ns += 60 * SECOND
            state = DoorState.OPEN if turn % 2 else DoorState.CLOSED
            log.append([DoorObserved(door_id=DoorId(n), state=state) for n in range(20, turn, -1)])

    names = views_of(sl.read(tmp_path / "log"), tmp_path)

    curves = [f"door {n} (UTC)" for n in range(13, 21)]
    assert curves == [n for n in names if n.startswith("door")]
    assert ["16 liveliest doors (UTC)", "All doors (UTC)"] == [n for n in names if "doors" in n]


def test_the_event_log_says_what_its_times_are_on_the_axes(tmp_path: Path) -> None:
    """The axes are in UTC; both offsets where clocks change within what is shown."""
    titles = []
    for hours in (1, 24 * 40):
        clock = SteadyClock(START)
        with sl.create(tmp_path / f"log{hours}", tz="Europe/Vienna", clock=clock) as log:
            log.append([DoorAdded(door_id=DoorId(1))])
            clock.now_ns += hours * 3600 * SECOND
            log.append([DoorObserved(door_id=DoorId(1), state=DoorState.OPEN)])
        names = views_of(sl.read(tmp_path / f"log{hours}"), tmp_path)
        titles += [name for name in names if name.startswith("Event log")]

    assert "Event log (Europe/Vienna, UTC+1)" == titles[0]
    assert "Event log (Europe/Vienna, UTC+1 and UTC+2)" == titles[1]


def test_chosen_doors_get_the_curves(tmp_path: Path) -> None:
    """Only doors with probabilities have any."""
    log = small_log(tmp_path / "log")

    names = views_of(log, tmp_path, doors=[DoorId(2)])

    expected = ["Costmap", "Door states (UTC)", "Event log (UTC)", "Floor plan", "Rounds (UTC)"]
    assert expected == names


def test_the_level_of_a_chosen_door_is_in_front(tmp_path: Path) -> None:
    """Not that of the robot, which is elsewhere."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([LevelAdded(level=n, name=name) for n, name in enumerate("AB", start=1)])
        log.append([DoorAdded(door_id=DoorId(n), level=n, x=0, y=0, theta=0, width=1)
                    for n in (1, 2)])  # fmt: skip
        log.append([RobotPose(level=1, x=0.0, y=0.0, theta=0.0)])
    read = sl.read(tmp_path / "log")

    assert ["A", "B"] == [plan_in_front(read, tmp_path, doors=doors) for doors in (None, [2])]


def plan_in_front(log: sl.DoorLog, tmp_path: Path, **how: Any) -> str:
    """Return the name of the view that is on top of the tabs of plans."""
    import rerun as rr

    save_rrd(log, tmp_path / "x.rrd", **how)
    reader = rr.chunk.RrdReader(tmp_path / "x.rrd")
    (store,) = reader.blueprints()
    names, tops = {}, []
    for chunk in reader.stream(store=store):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:display_name" in batch.schema.names:
            ((name,),) = batch.column("ViewBlueprint:display_name").to_pylist()
            names[chunk.entity_path.lstrip("/")] = name
        if "ContainerBlueprint:active_tab" in batch.schema.names:
            tops += [path.lstrip("/") for (path,)
                     in batch.column("ContainerBlueprint:active_tab").to_pylist()]  # fmt: skip
    return next(names[top] for top in tops if names.get(top) in ("A", "B"))
