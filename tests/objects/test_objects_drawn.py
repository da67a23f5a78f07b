"""What objects draw into a costmap: by their geometry, their class, their state or belief."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, LETHAL, NO_INFORMATION
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at, costmap_frames, costmap_live
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CommandError
from semmap_log.interop.exporting.costmap_files import write_costmap

ROOM = FloorMap(
    level=0, resolution=0.25, origin_x=0.0, origin_y=-1.0, cells=np.zeros((24, 32), np.int8)
)


def cost_at(log: sl.DoorLog, x: float, y: float, **how: object) -> int:
    """Return what the layer of doors says of a point."""
    drawn = costmap_at(log, CostmapOptions(**how), floor=ROOM)  # type: ignore[arg-type]
    cell = drawn.geometry.world_to_map(x, y)
    assert cell is not None
    return int(drawn.layer.costs[cell[1], cell[0]])


def lethal_cells(log: sl.DoorLog, **how: object) -> int:
    drawn = costmap_at(log, CostmapOptions(**how), floor=ROOM)  # type: ignore[arg-type]
    return int(np.count_nonzero(drawn.layer.costs == LETHAL))


def test_each_is_drawn_by_what_it_is(log: sl.DoorLogWriter) -> None:
    assert FREE_SPACE == cost_at(log, 1.5, 1.1)  # the open door
    assert NO_INFORMATION == cost_at(log, 4.1, 2.1)  # a dock that is free
    assert LETHAL == cost_at(log, 6.0, 0.1)  # the shutter is down
    assert LETHAL == cost_at(log, 2.5, 3.2)  # within the spill
    assert NO_INFORMATION == cost_at(log, 1.2, 3.8)  # beside it


def test_a_point_blocks_its_cell(log: sl.DoorLogWriter) -> None:
    before = lethal_cells(log)

    log.observe("west", "taken")

    assert LETHAL == cost_at(log, 4.1, 2.1)
    assert before + 1 == lethal_cells(log)


def test_what_does_not_block_leaves_the_floor_alone(log: sl.DoorLogWriter) -> None:
    """A door below a spill that has dried is seen; a wall below it stays a wall."""
    log.observe(4, "dry")
    door = log.add_door(x=1.5, y=3.1, theta=0.0, width=1.0, state="closed", door_id=sl.DoorId(9))
    assert LETHAL == cost_at(log, 2.0, 3.1)
    over = log.add_door(object_class="spill", outline=[(0, 2), (4, 2), (4, 5), (0, 5)], state="dry")

    assert over > door
    assert LETHAL == cost_at(log, 2.0, 3.1)
    log.observe(over, "wet")
    log.observe(door, "open")
    assert LETHAL == cost_at(log, 2.0, 3.1)
    log.observe(over, "dry")
    assert FREE_SPACE == cost_at(log, 2.0, 3.1)


def test_a_wet_floor_lies_above_doors(log: sl.DoorLogWriter) -> None:
    """Whatever their ids: a door that is open, or not known, does not dry it."""
    log.add_door(x=2.0, y=3.2, theta=0.0, width=0.9, state="open")
    assert LETHAL == cost_at(log, 2.5, 3.2)
    log.add_door(x=2.0, y=3.2, theta=0.0, width=0.9)
    assert LETHAL == cost_at(log, 2.5, 3.2)


@pytest.mark.parametrize(
    ("blocks", "p_open", "cost"),
    [("CLOSED", 0.25, 189), ("OPEN", 0.25, 63), ("OPEN,CLOSED", 0.25, 252), ("", 0.25, 0)],
)
def test_belief_costs_how_likely_it_blocks(
    log: sl.DoorLogWriter, blocks: str, p_open: float, cost: int
) -> None:
    log.define_class("shutter", blocks=blocks)
    log.update_door("bay", prob_open=p_open)

    assert cost == cost_at(log, 6.0, 0.1, by="belief")


def test_the_objects_of_a_class_alone(log: sl.DoorLogWriter, tmp_path) -> None:
    """And of the others nothing is told; a class that there is not is refused."""
    assert NO_INFORMATION == cost_at(log, 6.0, 0.1, object_class="spill")
    assert LETHAL == cost_at(log, 2.5, 3.2, object_class="spill")
    assert FREE_SPACE == cost_at(log, 1.5, 1.1, object_class="door")
    with pytest.raises(CommandError, match="no class 'spil'; there are: door, dock, shutter"):
        cost_at(log, 0.0, 0.0, object_class="spil")

    for name in ("west", "bay"):
        options = CostmapOptions(object_class="dock" if name == "west" else "shutter")
        made = write_costmap(log, costmap_at(log, options, floor=ROOM), tmp_path / "c.npy")
        told = [(door.name, why) for door, why in made.left_out]
        assert told == ([("west", "of which nothing blocks")] if name == "west" else [])


def test_without_a_floor_the_grid_holds_all_of_an_area(log: sl.DoorLogWriter) -> None:
    log.add_door(object_class="spill", outline=[(-9.0, 0.0), (0.0, 12.0), (14.0, 1.0)], state="wet")

    geometry = costmap_at(log, CostmapOptions()).geometry

    assert all(geometry.world_to_map(*corner) for corner in [(-9.0, 0.0), (0.0, 12.0), (14.0, 1.0)])


def told(log: sl.DoorLogWriter) -> Sequence[str]:
    """Tell of an object, its class and its place, one commit after the other."""
    log.observe("west", "taken")
    log.define_class("dock", geometry="point", states="free,taken", blocks="free,taken")
    new = log.add_door(x=2.0, y=2.0, theta=0.0, width=0.0, state="closed")
    log.annotate(new, "class", "spill")
    log.annotate(new, "outline", "0,0 1,0 1,1 0,1")
    log.update_door(new, x=4.0, y=4.0, theta=1.0)
    log.annotate(new, "outline", "0,0 2,0 2,2")
    log.define_class("spill", geometry="polygon", states="dry,wet", blocks="dry")
    log.define_class("spill", geometry="point", states="dry,wet", blocks="wet")
    log.annotate("bay", "class", "")
    log.remove_door(new)
    return []


def test_the_costmap_over_time_is_that_of_each_moment(log: sl.DoorLogWriter) -> None:
    """Frame by frame, on the same grid."""
    begin = log.end_ns()
    told(log)

    frames = 0
    for frame in costmap_frames(log, since=f"@{begin}", floor=ROOM):
        alone = costmap_at(log, at=f"@{frame.at_ns}", floor=ROOM)
        np.testing.assert_array_equal(alone.layer.costs, frame.costmap.layer.costs)
        frames += 1
    assert frames > 8
    for frame in costmap_frames(log, since=f"@{begin}"):  # on a grid that has room for all
        assert frame.costmap.geometry.world_to_map(5.0, 6.0)

    grown = log.end_ns()
    log.annotate(4, "outline", "0,0 29,0 29,29")  # and stays where it is
    for frame in costmap_frames(log, since=f"@{grown}"):
        assert frame.costmap.geometry.world_to_map(29.9, 31.9)


def test_live_it_is_that_of_now(log: sl.DoorLogWriter, path) -> None:
    reader, seen = sl.read(path), 0
    stop = iter([False] * 30)
    live = costmap_live(reader, floor=ROOM, poll_s=0.0, stop=lambda: next(stop, True))
    next(live)
    told(log)
    for frame in live:
        there = costmap_at(sl.read(path), event=frame.event, floor=ROOM)
        np.testing.assert_array_equal(there.layer.costs, frame.costmap.layer.costs)
        seen += 1
    assert seen > 8
