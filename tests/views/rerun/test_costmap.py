"""The costmap's door layer in a recording: put together from its patches, it is the replay's."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.analysis.costmap_2d.costs import LETHAL, NO_INFORMATION, drawn
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at
from semmap_log.analysis.costmaps.door_layer_fold import door_lines
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorRemoved,
    DoorUpdated,
    Event,
    Retracted,
)
from semmap_log.views.palette import DEFAULT
from semmap_log.views.rerun.costmap_pictures import shades_of_costs
from semmap_log.views.rerun.recording import save_rrd
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import (
    SECOND,
    START,
    Drawn,
    restless_log,
    room,
    small_log,
    wild_log,
)

pytestmark = pytest.mark.viewer

BUFFER, FORMAT = "SegmentationImage:buffer", "SegmentationImage:format"
PLACE, SCALE = "Transform3D:translation", "Transform3D:scale"
FLOOR = room()
GEOMETRY = GridGeometry.of_map(FLOOR.cells.shape, FLOOR.resolution, (-5.0, -4.0))


def recorded(log: sl.DoorLog, tmp_path: Path, **how: Any) -> Drawn:
    save_rrd(log, tmp_path / "x.rrd", **how)
    return Drawn(tmp_path / "x.rrd")


def layer_seen(
    drawing: Drawn,
    at: int,
    *,
    timeline: str = "happened",
    root: str = "/map",
    geometry: GridGeometry = GEOMETRY,
) -> NDArray[np.uint8]:
    """Put the doors' pictures together as they lie at a time; no two show the same cell."""
    layer = np.full(geometry.shape, NO_INFORMATION, np.uint8)
    for entity in sorted(drawing.entities):
        buffer = drawing.latest(entity, BUFFER, at, timeline)
        if not entity.startswith(f"{root}/costmap/") or buffer is None:
            continue
        (form,) = drawing.latest(entity, FORMAT, at, timeline)
        (place,) = drawing.latest(entity, PLACE, at, timeline)
        (scale,) = drawing.latest(entity, SCALE, at, timeline)
        np.testing.assert_allclose([geometry.resolution, geometry.resolution, 1], scale)
        x = round((place[0] - geometry.origin_x) / geometry.resolution)
        y = round((place[1] - geometry.origin_y) / geometry.resolution)
        picture = np.frombuffer(bytes(buffer[0]), np.uint8).reshape(form["height"], form["width"])
        part = layer[y : y + form["height"], x : x + form["width"]]
        shown = picture != NO_INFORMATION
        assert (part[shown] == NO_INFORMATION).all()
        part[shown] = picture[shown]
    return layer


def crowded_log(path: Path, *, seed: int, floor: bool = True) -> sl.DoorLog:
    """Doors that lie on each other, are moved, seen, told of late, and removed."""
    rng = random.Random(seed)
    clock = SteadyClock(START)
    doors = [DoorId(n) for n in (7, 2, 9, 4, 1, 3)]
    with sl.create(path, tz="UTC", clock=clock) as log:
        if floor:
            log.append([FLOOR])
        for door in doors:
            clock.now_ns += 60 * SECOND
            log.append([DoorAdded(door_id=door, **_place(rng), state=rng.choice(list(DoorState)))])
        for _ in range(150):
            clock.now_ns += 60 * SECOND
            door = rng.choice(doors)
            if rng.random() < 0.03 and len(doors) > 2:
                log.append([DoorRemoved(door_id=door)])
                doors.remove(door)
                continue
            happened_ns = clock.now_ns - rng.choice([0, 0, rng.randrange(600)]) * SECOND
            log.append([_change(rng, door, happened_ns)])
    return sl.read(path)


def _place(rng: random.Random) -> dict[str, float]:
    x, y = rng.choice([-0.51, 0.01, 0.26]), rng.choice([-0.51, 0.01, 0.26])
    theta = rng.choice([0.0, math.pi / 4, math.pi / 2, math.pi])
    return {"x": x, "y": y, "theta": theta, "width": rng.choice([0.5, 1.0])}


def _change(rng: random.Random, door: DoorId, happened_ns: int) -> Event:
    if rng.random() < 0.7:
        state = rng.choice([DoorState.OPEN, DoorState.CLOSED, DoorState.UNKNOWN])
        return DoorObserved(door_id=door, state=state, happened_ns=happened_ns)
    changed = Changed.POSE | Changed.WIDTH
    return DoorUpdated(door_id=door, changed=changed, **_place(rng), happened_ns=happened_ns)


@pytest.mark.parametrize("seed", range(4))
def test_at_any_moment_the_patches_are_the_replayed_layer(seed: int, tmp_path: Path) -> None:
    """Cell for cell, where doors lie on each other too."""
    log = crowded_log(tmp_path / "log", seed=seed)
    rng = random.Random(seed)

    drawing = recorded(log, tmp_path)

    for moment in [rng.randrange(START, log.end_ns() + 1) for _ in range(40)]:
        true = costmap_at(log, at=moment, floor=FLOOR).layer.costs
        np.testing.assert_array_equal(true, layer_seen(drawing, moment))
        known = costmap_at(log, known_at=moment, floor=FLOOR).layer.costs
        np.testing.assert_array_equal(known, layer_seen(drawing, moment, timeline="recorded"))


def test_the_event_at_the_cursor_made_the_layer(tmp_path: Path) -> None:
    """Along `event` it is the layer up to that number."""
    log = crowded_log(tmp_path / "log", seed=9)

    drawing = recorded(log, tmp_path)

    for number in range(3, log.replay().event, 11):
        expected = costmap_at(log, event=number, floor=FLOOR).layer.costs
        np.testing.assert_array_equal(expected, layer_seen(drawing, number, timeline="event"))


@pytest.mark.parametrize("seed", range(2))
def test_each_level_has_its_own_layer(seed: int, tmp_path: Path) -> None:
    """A door that moves to another level, or loses its place, leaves no ghost."""
    restless_log(tmp_path / "log", seed=seed)
    with sl.append(tmp_path / "log", clock=SteadyClock(START + 10**6 * SECOND)) as log:
        log.append([room(1), room(2)])
    read = sl.read(tmp_path / "log")
    rng = random.Random(seed)

    drawing = recorded(read, tmp_path)

    for moment in [rng.randrange(START, START + 300 * 60 * SECOND) for _ in range(25)]:
        for level, name in ((1, "ground"), (2, "first")):
            expected = costmap_at(read, CostmapOptions(level=level), at=moment, floor=room(level))
            np.testing.assert_array_equal(
                expected.layer.costs, layer_seen(drawing, moment, root=f"/map/{name}")
            )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_what_was_taken_back_is_in_the_layer_until_then(seed: int, tmp_path: Path) -> None:
    """Along all timelines, with late events and removals, and doors that return or never were."""
    log = wild_log(tmp_path / "log", seed=seed)
    rng = random.Random(seed)

    drawing = recorded(log, tmp_path, beliefs=False)

    numbers = [rng.randrange(4, log.replay().event) for _ in range(25)]
    happened, known = (
        [max(getattr(log.event(n), name), START + SECOND) for n in numbers]
        for name in ("happened_ns", "recorded_ns")
    )
    for name, scope, moments in (
        ("happened", "at", happened), ("recorded", "known_at", known), ("event", "event", numbers),
    ):  # fmt: skip
        for moment in moments:
            how: dict[str, Any] = {scope: moment}
            expected = costmap_at(log, CostmapOptions(level=1), **how, floor=room(1)).layer.costs
            seen = layer_seen(drawing, moment, timeline=name, root="/map/ground")
            np.testing.assert_array_equal(expected, seen)


def test_without_a_floor_map_the_cells_lie_on_a_grid_of_5_cm(tmp_path: Path) -> None:
    """Its cells begin at multiples of 0.05 m, as those of the costmap around the doors."""
    log = crowded_log(tmp_path / "log", seed=3, floor=False)
    geometry = GridGeometry(80, 80, 0.05, -2.0, -2.0)

    drawing = recorded(log, tmp_path)

    lines = door_lines(log.replay())
    assert len(lines) > 1
    expected = drawn(geometry, lines)
    assert (expected == LETHAL).any()
    np.testing.assert_array_equal(expected, layer_seen(drawing, log.end_ns(), geometry=geometry))


def test_a_part_begins_with_the_layer_as_it_was(tmp_path: Path) -> None:
    """With `since` the doors lie there from the first row on."""
    log = crowded_log(tmp_path / "log", seed=5)
    since = START + 90 * 60 * SECOND

    drawing = recorded(log, tmp_path, since=since)

    for moment in (since, since + 600 * SECOND, log.end_ns()):
        expected = costmap_at(log, at=moment, floor=FLOOR).layer.costs
        np.testing.assert_array_equal(expected, layer_seen(drawing, moment))


def test_a_row_is_written_only_when_the_picture_changes(tmp_path: Path) -> None:
    """
    A sighting that repeats and a change of the probability add nothing, one that is undone nothing
    along `happened`; an unknown door shows nothing, and once it is closed again it is back.
    """
    door = DoorId(1)
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([FLOOR, DoorAdded(door_id=door, x=0, y=0, theta=0, width=1,
                                     state=DoorState.CLOSED)])  # fmt: skip
        log.append([DoorObserved(door_id=door, state=DoorState.CLOSED)])
        log.append([DoorUpdated(door_id=door, changed=Changed.PROB_OPEN, prob_open=0.5)])
        log.append([DoorObserved(door_id=door, state=DoorState.OPEN)])
        log.append([Retracted(first_event=4, last_event=4)])
        log.append([DoorObserved(door_id=door, state=DoorState.UNKNOWN)])
        log.append([DoorObserved(door_id=door, state=DoorState.CLOSED)])

    drawing = recorded(sl.read(tmp_path / "log"), tmp_path)

    entity = "/map/costmap/door_1"
    assert [1, 4, 5, 7] == [number for number, _ in drawing.rows(entity, BUFFER, "event")]
    assert [6] == [number for number, _ in drawing.rows(entity, "Clear:is_recursive", "event")]
    assert [bytes([LETHAL]) * 21] * 2 == [
        bytes(value[0]) for _, value in drawing.rows(entity, BUFFER)
    ]


def test_of_two_events_at_one_time_the_later_one_shows(tmp_path: Path) -> None:
    """A door that is lost and closed in the same nanosecond is closed; along `event` it is both."""
    door = DoorId(1)
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([FLOOR, DoorAdded(door_id=door, x=0, y=0, theta=0, width=1,
                                     state=DoorState.OPEN)])  # fmt: skip
        clock.now_ns = START + 10 * SECOND
        log.append([DoorObserved(door_id=door, state=state, happened_ns=START + 5 * SECOND)
                    for state in (DoorState.UNKNOWN, DoorState.CLOSED)])  # fmt: skip

    drawing = recorded(sl.read(tmp_path / "log"), tmp_path)

    assert LETHAL in layer_seen(drawing, START + 10 * SECOND)
    assert (layer_seen(drawing, 2, timeline="event") == NO_INFORMATION).all()
    assert LETHAL in layer_seen(drawing, 3, timeline="event")


def test_a_turned_plan_has_no_costmap(tmp_path: Path) -> None:
    """Its cells do not lie along the axes; the doors' lines are drawn all the same."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([room(theta=0.1)])
        log.append([DoorAdded(door_id=DoorId(1), x=0, y=0, theta=0, width=1)])

    drawing = recorded(sl.read(tmp_path / "log"), tmp_path)

    assert "/map/doors/door_1" in drawing.entities
    assert not [entity for entity in drawing.entities if "costmap" in entity]


def test_it_can_be_left_out(tmp_path: Path) -> None:
    """With `costmap=False` there is no entity and no view of it."""
    log = small_log(tmp_path / "log")

    drawing = recorded(log, tmp_path, costmap=False)

    assert not [entity for entity in drawing.entities if "costmap" in entity]


def test_a_door_of_a_kilometre_shows_its_line_alone(tmp_path: Path) -> None:
    """A picture of all cells around it would fill the recording."""
    drawing = _two_doors(tmp_path, width=1e3)

    assert {"/map/doors/door_1", "/map/costmap/door_2"} <= drawing.entities
    assert "/map/costmap/door_1" not in drawing.entities


def test_a_building_larger_than_any_grid_has_no_costmap(tmp_path: Path) -> None:
    """The doors' lines are drawn all the same."""
    drawing = _two_doors(tmp_path, width=1e9)

    assert {"/map/doors/door_1", "/map/doors/door_2"} <= drawing.entities
    assert not [entity for entity in drawing.entities if "/costmap/" in entity]


def _two_doors(tmp_path: Path, *, width: float) -> Drawn:
    """Return what is drawn of a door of that width and one of a metre, both closed."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=DoorId(n), x=0, y=n, theta=0.5, width=metres,
                              state=DoorState.CLOSED)
                    for n, metres in ((1, width), (2, 1.0))])  # fmt: skip
    return recorded(sl.read(tmp_path / "log"), tmp_path)


def test_costs_have_the_colours_of_the_doors() -> None:
    """Free as an open door, lethal as a closed one, no information transparent."""
    shades = shades_of_costs(DEFAULT)

    assert [*DEFAULT.open, 255] == shades[0].tolist()
    assert [*DEFAULT.closed, 255] == shades[LETHAL].tolist()
    assert [*DEFAULT.unknown, 255] == shades[252].tolist()
    assert 0 == shades[NO_INFORMATION, 3]
