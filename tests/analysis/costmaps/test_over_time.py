"""A level's costmap: of any moment, over time, and live beside a writer."""

from __future__ import annotations

import math
import random
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, LETHAL, NO_INFORMATION, drawn
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at, costmap_frames, costmap_live
from semmap_log.analysis.costmaps.door_layer_fold import DoorLayerProjection, door_lines
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import Changed, DoorUpdated, FloorMap, LevelAdded, Retracted
from semmap_log.errors import CommandError, CostmapError, UnknownLevelError

GRID = GridGeometry(200, 160, 0.1, -10.0, -8.0)
INFLATED = CostmapOptions(level=0, inflate_m=0.5, inscribed_m=0.2, door_inflate_m=0.8)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A log of three levels of time: a door that is closed, then open, then moved."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(x=1.05, y=1.05, theta=0.0, width=1.0, state="closed", at="@100")
        log.observe(door, "open", at="@200")
        log.update_door(door, y=3.05, at="@300")
    return tmp_path / "log"


def _floor(value: int = 0, **more: float) -> FloorMap:
    cells = np.full((60, 50), value, np.int8)
    return FloorMap(resolution=0.1, origin_x=0.0, origin_y=0.0, cells=cells, **more)


def test_over_time(path: Path) -> None:
    """A frame for each moment at which a door is drawn otherwise, and what changed with it."""
    log = sl.read(path)

    frames = [
        (frame.at_ns // 10**9, [window.shape for window in frame.windows],
         frame.costmap.layer.costs[10, 12].item())
        for frame in costmap_frames(log, floor=_floor())
    ]  # fmt: skip

    assert [(99, [(60, 50)], 255), (100, [(1, 11)], 254), (200, [(1, 11)], 0),
            (300, [(1, 11), (1, 11)], 255)] == frames  # fmt: skip


def _random_log(path: Path, dice: random.Random) -> sl.DoorLog:
    """A log of doors that come, change, move and go; many events are late, some taken back."""
    with sl.create(path, tz="UTC") as log:
        for _ in range(150):
            with suppress(CommandError):  # not of this door, not at this time
                _happens(log, dice)
    return sl.read(path)


def _happens(log: sl.DoorLogWriter, dice: random.Random) -> None:
    at = f"@{dice.randint(1, 60)}"
    door = DoorId(dice.randint(0, max(0, len(log.replay()) - 1)))
    place = {"x": dice.uniform(-11, 10), "y": dice.uniform(-9, 8), "theta": dice.uniform(-4, 4)}
    state = dice.choice(["open", "closed", "unknown", "moving"])
    match dice.randrange(12):
        case 0 | 1 | 2:
            new = None if log.state.used_door_ids else DoorId(0)
            width = dice.uniform(0.2, 4)
            log.add_door(**place, door_id=new, width=width, state=state, at=at)
        case 3 | 4:
            log.update_door(door, x=place["x"], y=place["y"], theta=place["theta"], at=at)
        case 5:
            log.update_door(door, prob_open=dice.random(), at=at)
        case 6 if dice.random() < 0.4:
            log.remove_door(door, at=at)
        case 7:
            log.retract(dice.randint(0, log.state.event))
        case _:
            log.observe(door, state, at=at)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_frames_are_the_costmaps_of_their_moments(seed: int, tmp_path: Path) -> None:
    """Each frame of a random log is the costmap of its moment."""
    log = _random_log(tmp_path / "log", random.Random(seed))
    floor = FloorMap(resolution=0.1, origin_x=-10.0, origin_y=-8.0,
                     cells=np.zeros(GRID.shape, np.int8))  # fmt: skip
    frames = [
        (frame.at_ns, frame.costmap.layer.costs.copy(), frame.costmap.master.costs.copy())
        for frame in costmap_frames(log, INFLATED, floor=floor)
    ]

    for (at_ns, layer, master), (next_ns, *_) in pairwise([*frames, (log.end_ns() + 1,)]):
        for moment in (at_ns, next_ns - 1):
            expected = costmap_at(log, INFLATED, at=moment, floor=floor)
            assert np.array_equal(expected.layer.costs, layer)
            assert np.array_equal(expected.master.costs, master)
    assert 20 < len(frames)


@pytest.mark.slow
@pytest.mark.parametrize("by", ["state", "belief"])
@pytest.mark.parametrize("seed", range(2))
def test_the_layer_after_any_events_is_that_of_the_door_map(
    seed: int, by: str, tmp_path: Path
) -> None:
    """Folded in batches of any size, however late their events are, or drawn at once."""
    dice = random.Random(seed)
    log = _random_log(tmp_path / "log", dice)
    projection = DoorLayerProjection(GRID, by=by)

    state, seen = projection.initial(), set()
    for batch in log.batches():
        cut = dice.randrange(1, len(batch) + 1)
        for numbers in (
            batch.number < batch.number[cut - 1],
            batch.number >= batch.number[cut - 1],
        ):
            before = state.layer.costs.copy()
            state = projection.apply(state, batch.select(numbers)) if numbers.any() else state
            outside = np.ones(GRID.shape, np.bool_)
            for window in state.changed:
                outside[window.slices] = False
            assert not numbers.any() or np.array_equal(before[outside], state.layer.costs[outside])

            seen |= set(state.layer.costs.ravel().tolist())

    lines = door_lines(log.replay(), by=by)
    assert np.array_equal(drawn(GRID, lines), state.layer.costs)
    assert {LETHAL, FREE_SPACE, NO_INFORMATION} <= seen or by == "belief"
    assert len(seen) > 5 or by == "state"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_live_it_is_the_costmap_of_each_commit(seed: int, tmp_path: Path) -> None:
    """After each commit it is what a replay up to it gives, changed where it says so."""
    dice, floor = random.Random(seed), FloorMap(
        resolution=0.1, origin_x=-10.0, origin_y=-8.0, cells=np.zeros(GRID.shape, np.int8)
    )  # fmt: skip
    log = _random_log(tmp_path / "log", dice)
    live = costmap_live(log, INFLATED, floor=floor, poll_s=0, stop=lambda: True)
    costmap = next(live).costmap
    shown = costmap.master.costs.copy()
    with sl.append(tmp_path / "log") as writer:
        for _ in range(60):
            with suppress(CommandError):
                _happens(writer, dice)

    frames = 0
    for frame in live:
        frames += 1
        expected = costmap_at(sl.read(log.path), INFLATED, event=frame.event, floor=floor)
        assert np.array_equal(expected.master.costs, costmap.master.costs)
        for window in frame.windows:
            shown[window.slices] = costmap.master.costs[window.slices]
        assert np.array_equal(shown, costmap.master.costs)

    assert 10 < frames
    assert np.array_equal(
        costmap_at(sl.read(log.path), INFLATED, floor=floor).master.costs, costmap.master.costs
    )


def test_live_beside_a_writer(path: Path) -> None:
    """Each commit's cells, as they come; a retraction draws the layer anew."""
    opened, geometry = sl.read(path), GridGeometry(50, 60, 0.1)
    live = opened.fold_live(DoorLayerProjection(geometry), poll_s=0)
    first = next(live)
    costs = [first.state.layer.costs[30, 12].item()]
    with sl.append(path) as log:
        log.observe(1, "closed")
        second = next(live)
        costs.append(second.state.layer.costs[30, 12].item())
        log.append([Retracted(first_event=second.event, last_event=second.event)])
        third = next(live)
        costs.append(third.state.layer.costs[30, 12].item())

    assert [FREE_SPACE, LETHAL, FREE_SPACE] == costs
    assert [(1, 11)] == [window.shape for window in second.state.changed]
    assert (False, True) == (second.was_restarted, third.was_restarted)


@pytest.mark.parametrize(
    ("p_open", "p_closed", "cost"),
    [(1.0, math.nan, 0), (0.0, math.nan, 252), (0.25, math.nan, 189), (0.25, 0.1, 189),
     (math.nan, 0.5, 126), (math.nan, math.nan, LETHAL)],
)  # fmt: skip
def test_what_a_belief_costs(p_open: float, p_closed: float, cost: int, path: Path) -> None:
    """Probably closed costs much, but does not block; nothing believed: the state counts."""
    with sl.append(path) as log:
        log.observe(1, "closed", at="@400")
        log.update_door(1, prob_open=p_open, prob_closed=p_closed, at="@400")

    found = costmap_at(sl.read(path), CostmapOptions(by="belief"), floor=_floor())

    assert cost == found.layer.costs[30, 12]


def test_without_a_floor_the_grid_lies_around_the_doors(path: Path) -> None:
    """A metre around them, on whole cells; beside them nothing is known."""
    found = costmap_at(sl.read(path))
    over_time = next(costmap_frames(sl.read(path))).costmap.geometry

    assert GridGeometry(60, 41, 0.05, 0.05, 2.0) == found.geometry
    assert NO_INFORMATION == found.master.costs[0, 0]
    assert FREE_SPACE == found.master.costs[20, 22]
    for end in ((1.05, 1.05), (2.05, 1.05), (2.05, 3.05)):
        assert over_time.world_to_map(*end)


def test_doors_of_other_levels_and_without_a_place_are_not_drawn(tmp_path: Path) -> None:
    """A level is taken by number or name; of several one must be named."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([LevelAdded(level=1, name="ground"), LevelAdded(level=2, name="upper")])
        log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, state="closed", level=1)
        upper = log.add_door(x=1.0, y=2.0, theta=0.0, width=1.0, state="closed", level=2)
        log.add_door(state="open", level=1)
    log = sl.read(tmp_path / "log")

    assert [upper] == list(costmap_at(log, CostmapOptions(level="upper")).lines)
    with pytest.raises(UnknownLevelError, match=r"1 \(ground\), 2 \(upper\); say which"):
        costmap_at(log)
    with pytest.raises(CostmapError, match="level 0"):
        costmap_at(log, CostmapOptions(level=0))


def test_a_turned_floor_is_an_error(path: Path) -> None:
    """noetic ignores the yaw, and draws every door in a wrong place."""
    with pytest.raises(CostmapError, match=r"origin with yaw 0, got 0.5"):
        costmap_at(sl.read(path), floor=_floor(origin_theta=0.5))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (CostmapOptions(resolution=0.0), "resolution: expected metres a cell, above 0"),
        (CostmapOptions(resolution=math.nan), "resolution: expected metres a cell"),
        (CostmapOptions(resolution=1e-5), "expected at most 100,000,000 cells"),
        (CostmapOptions(inflate_m=-1.0), "inflation's radius: expected 0 or more"),
        (CostmapOptions(inflate_m=1.0, scaling=math.nan), "inflation's scaling"),
    ],
)
def test_what_no_costmap_can_be(options: CostmapOptions, said: str, path: Path) -> None:
    """It is said, not drawn."""
    with pytest.raises(CostmapError, match=said):
        costmap_at(sl.read(path), options)


def test_an_update_that_says_nothing_new_is_no_frame(path: Path) -> None:
    """A hundred sightings of an open door leave the costmap alone."""
    with sl.append(path) as log:
        for i in range(100):
            log.observe(1, "open", at=f"@{400 + i}")
        log.append([DoorUpdated(door_id=DoorId(1), prob_open=0.5, changed=Changed.PROB_OPEN)])

    assert 4 == len(list(costmap_frames(sl.read(path))))
