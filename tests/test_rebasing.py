"""A level has a new map: its doors move with it, history stays, all of it or nothing."""

from __future__ import annotations

import cmath
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at, costmap_frames
from semmap_log.analysis.planning.round_planner import begun_round
from semmap_log.core.folds.rebasing import MeasuredDoor
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import FloorMap, LevelAdded, RobotPose
from semmap_log.errors import CommandError, CommandReusedError, UnknownDoorError
from semmap_log.log.replay.maintenance import verify
from tests.conftest import SteadyClock
from tests.store.logs import segment_files
from tests.turned_maps import MOVED_AT, OFFICE, office_mapped_anew, turned

HOUR_NS = 3_600 * 10**9
ID = bytes(range(16))


def a_map(level: int = 0, *, x: float = 0.0, cells: tuple[int, int] = (200, 300)) -> FloorMap:
    drawn = np.zeros(cells, np.int8)
    return FloorMap(level=level, resolution=0.5, origin_x=x, origin_y=-50.0, cells=drawn)


def placed(path: Path, *places: tuple[float, float, float], clock: SteadyClock) -> sl.DoorLogWriter:
    log = sl.create(path, tz="UTC", clock=clock, durability="flush", compact=False)
    log.append([a_map()])
    for x, y, theta in places:
        log.add_door(x=x, y=y, theta=theta, width=0.9)
    return log


def pose(door: Door) -> tuple[float, float, float, float]:
    return door.x, door.y, door.theta, door.width


NUMBERS = st.floats(-50, 50, allow_nan=False)
POSES = st.tuples(NUMBERS, NUMBERS, st.floats(-3, 3, allow_nan=False))


@settings(max_examples=30, deadline=None)
@given(by=POSES, doors=st.lists(POSES, min_size=1, max_size=5))
def test_doors_turn_as_complex_numbers_do(
    tmp_path_factory: pytest.TempPathFactory,
    by: tuple[float, float, float],
    doors: list[tuple[float, float, float]],
) -> None:
    """Both ends of each; before that moment they lie where they lay."""
    clock = SteadyClock()
    with placed(tmp_path_factory.mktemp("log") / "log", *doors, clock=clock) as log:
        before, then_ns = log.replay(), clock.now_ns
        clock.now_ns += HOUR_NS
        appended = log.rebase(a_map(x=1.0), by=by, reason="mapped anew")
        after = log.replay()

        shift, turn = complex(by[0], by[1]), cmath.exp(1j * by[2])
        for door in before.doors.values():
            now = after[door.door_id]
            for old, new in ((door.start, now.start), (door.end, now.end)):
                assert abs(shift + turn * complex(*old) - complex(*new)) < 1e-6
            assert now.width == door.width
        assert [pose(d) for d in log.replay(at=then_ns).doors.values()] == [
            pose(d) for d in before.doors.values()
        ]
        assert log.floor_map().origin_x == 1.0
        assert log.floor_map(at=then_ns).origin_x == 0.0
        log.retract(appended.first_event, appended.first_event + appended.count - 1)
        assert [pose(d) for d in log.replay().doors.values()] == [
            pose(d) for d in before.doors.values()
        ]
        assert log.floor_map().origin_x == 0.0


def test_it_is_one_commit_that_is_stored_once(tmp_path: Path) -> None:
    """The same command again changes nothing; another with its id is refused."""
    with placed(tmp_path / "log", (1, 2, 0.5), (3, 2, 0), clock=SteadyClock()) as log:
        first = log.rebase(a_map(x=1.0), by=(1, 2, 0.5), actor="ann", command_id=ID)
        again = log.rebase(a_map(x=1.0), by=(1, 2, 0.5), actor="ann", command_id=ID)

        assert (first.commit.count, again.repeated) == (3, True)
        assert log.last_event() == first.commit.last_event
        with pytest.raises(CommandReusedError):
            log.rebase(a_map(x=1.0), by=(1, 2, 0.6), actor="ann", command_id=ID)
        with pytest.raises(CommandError, match="has this very map already, by event 3"):
            log.rebase(a_map(x=1.0), by=(1, 2, 0.5))
        assert {h.actor for h in log.history() if h.number >= 3} == {"ann"}


def test_what_is_not_on_the_level_stays(tmp_path: Path) -> None:
    """Doors of other levels, removed ones, and those without a place."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock()) as log:
        log.append([LevelAdded(level=n, name=f"L{n}", elevation=0.0) for n in (1, 2)])
        here = log.add_door(x=1, y=0, theta=0, width=1, level="L1")
        above = log.add_door(x=1, y=0, theta=0, width=1, level="L2")
        unplaced = log.add_door(level="L1")
        gone = log.add_door(x=1, y=0, theta=0, width=1, level="L1")
        log.remove_door(gone)

        appended = log.rebase(a_map(), by=(0, 5, 0), level="L1")

        doors = log.replay().doors
        assert (doors[here].y, doors[above].y, gone in doors) == (5, 0, False)
        assert not doors[unplaced].is_placed
        assert appended.count == 2
        assert log.floor_map("L1") is not None
        assert log.floor_map("L2") is None


def test_measured_doors_win(tmp_path: Path) -> None:
    """Over the transform; a door without a place gets one; a width only if it was measured."""
    with placed(tmp_path / "log", (1, 2, 0), (3, 2, 0), clock=SteadyClock()) as log:
        new = log.add_door(name="new")
        measured = {1: (7.0, 8.0, 0.1), "new": MeasuredDoor(1.0, 1.0, 0.0, 1.5)}
        log.rebase(a_map(x=1.0), by=(10, 0, 0), doors=measured)

        doors = log.replay().doors
        assert pose(doors[1]) == (7.0, 8.0, 0.1, 0.9)
        assert pose(doors[2]) == (13.0, 2.0, 0.0, 0.9)
        assert pose(doors[new]) == (1.0, 1.0, 0.0, 1.5)
        with pytest.raises(UnknownDoorError):
            log.rebase(a_map(x=2.0), by=(0, 0, 0), doors={"nobody": MeasuredDoor(0, 0, 0)})
        with pytest.raises(CommandError, match="door 9 is not in the map"):
            log.rebase(a_map(x=2.0), by=(0, 0, 0), doors={9: MeasuredDoor(0, 0, 0)})


def test_doors_that_were_placed_since_are_in_the_new_map(tmp_path: Path) -> None:
    """With `at` in the past: what was told behind it stands; a map from behind it is in the way."""
    clock = SteadyClock()
    with placed(tmp_path / "log", (1, 2, 0), (3, 2, 0), clock=clock) as log:
        moved_ns = clock.now_ns + HOUR_NS
        clock.now_ns += 2 * HOUR_NS
        log.update_door(2, x=99.0)
        late = log.add_door(x=50, y=50, theta=0, width=1)

        log.rebase(a_map(x=1.0), by=(10, 0, 0), at=moved_ns)

        doors = log.replay().doors
        assert (doors[1].x, doors[2].x, doors[late].x) == (11, 99, 50)
        at_once = log.replay(at=moved_ns).doors
        assert (at_once[1].x, at_once[2].x) == (11, 13)
        with pytest.raises(CommandError, match="another floor map from a later time"):
            log.rebase(a_map(x=2.0), by=(10, 0, 0), at=moved_ns - 1)


def test_a_clock_that_went_back_does_not_undo_it(tmp_path: Path) -> None:
    """What was told of later times came before it all the same."""
    clock = SteadyClock()
    with placed(tmp_path / "log", (1, 2, 0), clock=clock) as log:
        clock.now_ns -= HOUR_NS

        log.rebase(a_map(x=1.0), by=(10, 0, 0))

        assert (log.replay().doors[1].x, log.floor_map().origin_x) == (11, 1.0)


def test_the_costmap_turns_cell_for_cell(tmp_path: Path) -> None:
    """A quarter turn of the office: doors, floor and costs around both, on both sides."""
    log, old = sl.read(office_mapped_anew(tmp_path)), sl.read(OFFICE)
    inflated = CostmapOptions(inflate_m=0.4, inscribed_m=0.2)

    for at in ("2026-03-02T13:59:59", "2026-03-02T14:00", "2026-03-02T18:30"):
        new, before = (costmap_at(one, inflated, at=at) for one in (log, old))
        is_after = at >= MOVED_AT
        assert before.layer.costs[before.layer.costs != 255].size
        for one, other in ((new.master, before.master), (new.layer, before.layer)):
            expected = turned(other.costs) if is_after else other.costs
            np.testing.assert_array_equal(expected, one.costs)


def test_costmaps_over_time_change_their_grid(tmp_path: Path) -> None:
    """Each frame is the costmap of its moment, on the map of that moment."""
    log = sl.read(office_mapped_anew(tmp_path))
    shapes = set()

    for frame in costmap_frames(log, since="2026-03-02T08:00"):
        there = costmap_at(log, at=frame.at_ns)
        shapes.add(there.geometry.shape)
        assert frame.costmap.geometry == there.geometry
        np.testing.assert_array_equal(there.master.costs, frame.costmap.master.costs)

    assert len(shapes) == 2


def test_a_round_does_not_begin_where_the_robot_was_on_the_old_map(tmp_path: Path) -> None:
    """Nobody knows where it is, until it tells its place on the new one."""
    log = sl.read(office_mapped_anew(tmp_path))

    assert begun_round(log, start="2026-03-02T13:59").plan.start is not None
    assert begun_round(log, start="2026-03-02T14:30").plan.start is None
    assert begun_round(log, start="2026-03-02T15:30").plan.start is not None


def test_wherever_its_writing_ends_it_is_there_or_not(tmp_path: Path) -> None:
    """A map of several chunks: the file is cut behind any of its bytes, as a power cut may."""
    clock = SteadyClock()
    with placed(tmp_path / "log", (1, 2, 0), (3, 2, 0), clock=clock) as log:
        log.append([RobotPose(x=1, y=1, theta=0, sd_xy=0, sd_theta=0)])
        (segment,) = segment_files(tmp_path / "log")
        begin = segment.stat().st_size
        noise = np.random.default_rng(1).integers(-1, 101, (1500, 2000)).astype(np.int8)
        log.rebase(
            FloorMap(level=0, resolution=0.05, origin_x=1.0, origin_y=0.0, cells=noise),
            by=(10, 0, 0),
        )
        shutil.copytree(tmp_path / "log", tmp_path / "copy")
    whole = (tmp_path / "copy" / segment.name).read_bytes()
    cuts = [*range(begin, len(whole), (len(whole) - begin) // 12)]
    cuts += [*range(len(whole) - 700, len(whole) + 1, 50)]

    seen = []
    for cut in sorted(cuts):
        path = tmp_path / f"cut{cut}"
        shutil.copytree(tmp_path / "copy", path)
        (path / segment.name).write_bytes(whole[:cut])
        sl.append(path, compact=False).close()
        doors, floor = sl.read(path).replay().doors, sl.read(path).floor_map()
        seen.append((doors[1].x, doors[2].x, floor.origin_x))
        assert 0 == verify(path).exit_code
        shutil.rmtree(path)

    assert set(seen) == {(1, 3, 0.0), (11, 13, 1.0)}
    assert seen == sorted(seen)
    assert len(whole) - begin > 2 * 2**20
