"""A costmap over time as messages: what a player shows is what the costmap was."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import DoorLayer, DoorLine, to_occupancy
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.costmap_2d.layered import InflationLayer, LayeredCostmap
from semmap_log.errors import OutputError
from semmap_log.interop.formats.bags.bag_reading import new_bag
from semmap_log.interop.formats.ros.door_messages import GRIDS, UPDATES, GridFrame, write_grids
from tests.interop.formats.bags.played import Played, played, seen_by_rviz

SECOND = 10**9
START = 1_772_400_000 * SECOND
GEOMETRY = GridGeometry(60, 40, 0.05, -1.0, 2.0)
BAGS = ["x.mcap", "x.bag", "x"]


def restless(seed: int, changes: int = 40) -> Iterator[GridFrame]:
    """A costmap in which one of three doors changes every 1 to 40 s."""
    rng = random.Random(seed)
    layer = DoorLayer(GEOMETRY)
    costmap = LayeredCostmap(GEOMETRY, [layer, InflationLayer(GEOMETRY, radius=0.15)])
    costmap.update()
    at_ns = START
    yield GridFrame(at_ns, costmap.costs, [])
    for _ in range(changes):
        at_ns += rng.randrange(1, 40) * SECOND + rng.randrange(SECOND)
        door = rng.randrange(3)
        layer.update({door: DoorLine(rng.uniform(-1, 2), 2.5 + door / 2, rng.uniform(-1, 1), 0.9,
                                     rng.choice([0, 100, 254, 255]))})  # fmt: skip
        yield GridFrame(at_ns, costmap.costs, costmap.update())


def grids_of(frames: Iterator[GridFrame]) -> list[tuple[int, NDArray[np.int8]]]:
    """What is expected: the whole costmap at first, and at each time at which it changed."""
    grids: list[tuple[int, NDArray[np.int8]]] = []
    for frame in frames:
        cells = to_occupancy(frame.costs)
        if not grids or not np.array_equal(cells, grids[-1][1]):
            grids.append((frame.at_ns, cells))
    return grids


def write(path: Path, frames: Iterator[GridFrame], *, every_s: int = 60, updates: bool = True):
    with new_bag(path, [GRIDS, UPDATES] if updates else [GRIDS]) as bag:
        return write_grids(bag, GEOMETRY, frames, every_ns=every_s * SECOND, updates=updates)


def at(grids: Sequence[tuple[int, NDArray[np.int8]]], moment: int) -> NDArray[np.int8]:
    return [cells for at_ns, cells in grids if at_ns <= moment][-1]


@pytest.mark.parametrize("name", BAGS)
@pytest.mark.parametrize("every_s", [0, 60, 10_000])
def test_rviz_shows_the_costmap_at_each_time(name: str, every_s: int, tmp_path: Path) -> None:
    """Whole grids with the updates between them are the costmap as it was then."""
    expected = grids_of(restless(1))

    write(tmp_path / name, restless(1), every_s=every_s)

    last = dict.fromkeys([])
    for at_ns, cells in seen_by_rviz(played(tmp_path / name)):
        last[at_ns] = cells.copy()
    assert len(expected) > 20
    for at_ns, cells in expected:
        shown = [seen for time, seen in last.items() if time <= at_ns][-1]
        np.testing.assert_array_equal(cells, shown)


@pytest.mark.parametrize("name", BAGS)
def test_whole_grids_alone_are_never_far_behind(name: str, tmp_path: Path) -> None:
    """Without updates each change is seen at most `every` later."""
    expected = grids_of(restless(2))

    write(tmp_path / name, restless(2), every_s=60)

    grids = [each for each in played(tmp_path / name) if each.topic == GRIDS.name]
    for each in grids:
        np.testing.assert_array_equal(at(expected, each.at_ns), each.cells)
    times = [each.at_ns for each in grids]
    assert all(b - a >= 60 * SECOND for a, b in pairwise(times[:-1]))
    for changed_ns, _ in expected:
        next_ns = next(time for time in times if time >= changed_ns)
        assert next_ns - changed_ns <= 60 * SECOND
    assert len(times) < len(expected)


def test_a_change_at_the_very_time_of_a_grid_is_in_it(tmp_path: Path) -> None:
    """A grid was due at 60 s, and just then something else changed: one grid, with both."""
    costs = np.zeros(GEOMETRY.shape, np.uint8)

    def frames() -> Iterator[GridFrame]:
        yield GridFrame(START, costs, [])
        for column, after_s in enumerate((10, 60)):
            costs[0, column] = 254
            yield GridFrame(START + after_s * SECOND, costs, [GEOMETRY.whole])

    write(tmp_path / "x.mcap", frames())

    grids = [each for each in played(tmp_path / "x.mcap") if each.topic == GRIDS.name]
    assert [START, START + 60 * SECOND] == [each.at_ns for each in grids]
    assert [100, 100, 0] == grids[1].cells[0, :3].tolist()


def test_a_grid_at_each_change(tmp_path: Path) -> None:
    """With `every` 0 the whole grids are all the costmaps that there were, one a change."""
    expected = grids_of(restless(3))

    write(tmp_path / "x.mcap", restless(3), every_s=0, updates=False)

    messages = played(tmp_path / "x.mcap")
    assert [at_ns for at_ns, _ in expected] == [each.at_ns for each in messages]
    for (_, cells), each in zip(expected, messages, strict=True):
        np.testing.assert_array_equal(cells, each.cells)


def test_an_update_holds_no_row_and_column_too_many(tmp_path: Path) -> None:
    """Of a window in which two cells changed only the rectangle around them is sent."""
    costs = np.zeros(GEOMETRY.shape, np.uint8)

    def frames() -> Iterator[GridFrame]:
        yield GridFrame(START, costs, [])
        yield GridFrame(START + SECOND, costs, [GEOMETRY.whole])
        costs[10, 20] = costs[12, 25] = 254
        yield GridFrame(START + 2 * SECOND, costs, [GEOMETRY.whole])

    counts = write(tmp_path / "x.mcap", frames())

    (update,) = [each for each in played(tmp_path / "x.mcap") if each.topic == UPDATES.name]
    message = update.message
    assert (20, 10, 6, 3) == (message.x, message.y, message.width, message.height)
    assert {GRIDS.name: 2, UPDATES.name: 1} == counts


@pytest.mark.parametrize("name", BAGS)
def test_a_grid_says_when_and_where_it_is(name: str, tmp_path: Path) -> None:
    """Stamp and log time are the happened time; frame `map`; resolution as float32; no rotation."""
    write(tmp_path / name, restless(4))

    for each in played(tmp_path / name):
        stamp = each.message.header.stamp
        assert each.at_ns == stamp.sec * SECOND + stamp.nanosec
        assert "map" == each.message.header.frame_id
    first: Played = played(tmp_path / name)[0]
    info = first.message.info
    assert (START, GRIDS.name) == (first.at_ns, first.topic)
    assert (60, 40, np.float32(0.05)) == (info.width, info.height, info.resolution)
    assert (-1.0, 2.0, 1.0) == (info.origin.position.x, info.origin.position.y,
                                info.origin.orientation.w)  # fmt: skip


def test_the_middle_of_the_century_is_refused(tmp_path: Path) -> None:
    """A ROS stamp ends in January 2038: later times are an error, and no file is left."""
    costs = np.zeros(GEOMETRY.shape, np.uint8)

    with pytest.raises(OutputError, match="from 1970 to January 2038"):
        write(tmp_path / "x.mcap", iter([GridFrame(2**31 * SECOND, costs, [])]))

    assert [] == list(tmp_path.iterdir())
