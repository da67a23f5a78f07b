"""What is in a recording: read back without a viewer, asked as a viewer asks."""

from __future__ import annotations

import math
import resource
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorUpdated, Retracted, RobotPose
from semmap_log.errors import SemmapError
from semmap_log.views.rerun.recording import save_rrd
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START, Drawn, room, small_log

pytestmark = pytest.mark.viewer

STATE, STRIPS, SCALARS = "StateChange:state", "LineStrips2D:strips", "Scalars:scalars"


def recorded(log: sl.DoorLog, tmp_path: Path, **how: Any) -> Drawn:
    save_rrd(log, tmp_path / "x.rrd", **how)
    return Drawn(tmp_path / "x.rrd")


def test_a_small_log_gives_the_tree_that_the_docs_tell(tmp_path: Path) -> None:
    """
    One entity a door, under its name or number, below it one for what is believed of it, if enough
    is known, and one for its cells in the costmap, if it ever has any; plan, rooms, robot and
    events beside; no other timeline.
    """
    log = small_log(tmp_path / "log")

    drawn = recorded(log, tmp_path)

    assert {
        "/map", "/map/floor", "/map/rooms", "/map/doors/front", "/map/doors/door_2", "/map/costmap",
        "/map/doors/front/belief",
        "/map/costmap/front", "/map/robot/pose", "/map/robot/track",
        "/events/door_added", "/events/door_annotated",
        "/events/door_observed", "/events/door_passed", "/events/door_removed",
        "/events/door_updated", "/events/floor_map", "/events/patrol_started",
        "/events/patrol_finished", "/rounds/rover",
    } == {entity for entity in drawn.entities if not entity.startswith("/__")}  # fmt: skip
    assert {"happened", "recorded", "event"} == drawn.timelines
    assert (log.info.log_id, 1) == (drawn.store.recording_id, drawn.blueprints)


def test_rooms_are_named_where_they_have_a_name(tmp_path: Path) -> None:
    """By the doors' annotation; of a log whose rooms have none, no names are written."""
    office = Path(__file__).parents[3] / "recordings" / "office"

    drawn = recorded(sl.read(office), tmp_path)

    assert {"/map/rooms", "/map/room_names"} <= drawn.entities


def test_rows_carry_the_times_and_the_number_of_their_event(tmp_path: Path) -> None:
    """The number at the cursor can be given to `semmap-log show`."""
    log = small_log(tmp_path / "log")

    drawn = recorded(log, tmp_path)

    (number, _), *_ = reversed(drawn.rows("/map/doors/front", STATE, "event"))
    recorded_event = log.event(number)
    assert DoorState.CLOSED == recorded_event.event.state
    assert (recorded_event.recorded_ns, ["CLOSED"]) == drawn.rows(
        "/map/doors/front", STATE, "recorded"
    )[-1]


def test_the_event_log_says_who_and_why(tmp_path: Path) -> None:
    """Time, door, what; then actor and reason of the commit; changes before repeats."""
    log = small_log(tmp_path / "log")

    drawn = recorded(log, tmp_path)

    (removal,) = drawn.rows("/events/door_removed", "TextLog:text")
    assert ["03-01 21:50:00  door 2  removed from the map  · anna: a wall now"] == removal[1]
    assert ["WARN"] == drawn.rows("/events/door_removed", "TextLog:level")[0][1]
    sighting = drawn.rows("/events/door_observed", "TextLog:text")[0]
    assert sighting[1][0].endswith("front #1  seen OPEN (90%)  · rover")


def test_the_track_breaks_where_the_robot_was_unseen(tmp_path: Path) -> None:
    """No line is drawn over a gap of more than ten minutes, nor from one level to another."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([DoorAdded(door_id=DoorId(1), level=0, x=0, y=0, theta=0, width=1)])
        for minute, level, x in (
            (0, 0, 0.0),
            (1, 0, 1.0),
            (20, 0, 2.0),
            (21, 0, 3.0),
            (22, 7, 0.0),
        ):
            clock.now_ns = START + minute * 60 * SECOND
            log.append([RobotPose(level=level, x=x, y=0.0, theta=0.0)])

    drawn = recorded(sl.read(tmp_path / "log"), tmp_path)

    tracks = [value[0] for _, value in drawn.rows("/map/0/robot/track", STRIPS)]
    assert [[[0, 0], [1, 0]], [[2, 0], [3, 0]]] == tracks
    assert [] == drawn.rows("/map/7/robot/track", STRIPS)
    gone_ns = drawn.rows("/map/7/robot/pose", "Arrows2D:origins")[0][0]
    assert drawn.latest("/map/0/robot/pose", "Arrows2D:origins", gone_ns - 1)
    assert [] == drawn.latest("/map/0/robot/pose", "Arrows2D:origins", gone_ns)


def test_the_plan_lies_where_its_cells_are(tmp_path: Path) -> None:
    """Walls are light on dark; the picture's first row is the lowest y."""
    plan = room(theta=math.pi / 2)
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([plan])

    drawn = recorded(sl.read(tmp_path / "log"), tmp_path)

    (buffer,), (shape,) = (drawn.statics["/map/floor", f"Image:{n}"] for n in ("buffer", "format"))
    picture = np.frombuffer(bytes(buffer), np.uint8).reshape(shape["height"], shape["width"], 3)
    assert ((150, 160, 176), (41, 46, 57)) == (tuple(picture[0, 0]), tuple(picture[80, 100]))
    ((first_column),) = drawn.statics["/map/floor", "Transform3D:mat3x3"]
    np.testing.assert_allclose([0, 0.05, 0], first_column[:3], atol=1e-7)
    np.testing.assert_allclose([1, -1, 1], drawn.statics["/map", "Transform3D:scale"][0])


def test_a_part_begins_with_the_state_as_it_was(tmp_path: Path) -> None:
    """With `since`, the first rows stand at that moment and tell what a replay to it gives."""
    log = small_log(tmp_path / "log")
    since_ns = START + 900 * SECOND

    drawn = recorded(log, tmp_path, since=since_ns, until=START + 2000 * SECOND)

    assert [(since_ns, ["OPEN"])] == drawn.rows("/map/doors/front", STATE)
    assert (since_ns, [0.5, 0.75]) == drawn.rows("/map/doors/front", SCALARS)[0]
    assert drawn.latest("/map/doors/door_2", STRIPS, since_ns)
    assert drawn.latest("/map/doors/door_2", STRIPS, START + 1900 * SECOND) is None
    assert ["UNKNOWN"] == drawn.latest("/map/doors/door_2", STATE, since_ns)


@pytest.mark.filterwarnings("error")
def test_what_lies_beyond_all_buildings_is_no_matter(tmp_path: Path) -> None:
    """A door and poses that a viewer's numbers cannot hold."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.add_door(x=1e300, y=-1e300, theta=0, width=1e300)
        log.add_door(x=1, y=2, theta=0, width=1)
        log.append([RobotPose(x=1e300, y=0, theta=1e300), RobotPose(x=2, y=1e300, theta=0)])

    drawn = recorded(sl.read(tmp_path / "log"), tmp_path)

    assert [[[1, 2], [2, 2]]] == drawn.latest("/map/doors/door_2", STRIPS, START + SECOND)


def test_chosen_doors_keep_the_robot_and_its_patrols(tmp_path: Path) -> None:
    """`doors` leaves the other doors out of plan, lanes and text."""
    log = small_log(tmp_path / "log")

    drawn = recorded(log, tmp_path, doors=[DoorId(1)])

    assert "/map/doors/front" in drawn.entities
    assert "/map/robot/track" in drawn.entities
    assert "/events/patrol_started" in drawn.entities
    assert not {"/map/doors/door_2", "/events/door_removed"} & drawn.entities


def test_retracted_events_are_told_along_recorded_alone(tmp_path: Path) -> None:
    """There the line of an undone sighting says that it was undone; so does the undoing itself."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=DoorId(1), x=0, y=0, theta=0, width=1)])
        log.append([DoorObserved(door_id=DoorId(1), state=DoorState.OPEN)])
        log.append([Retracted(first_event=1, last_event=1)])

    drawn = recorded(sl.read(tmp_path / "log"), tmp_path)

    assert [] == drawn.rows("/events/door_observed", "TextLog:text")
    ((number, (text,)),) = drawn.rows("/events/door_observed", "TextLog:text", "event")
    assert 1 == number
    assert text.endswith("door 1  seen OPEN (taken back later)")
    assert "/events/retracted" in drawn.entities


def test_an_empty_log_is_a_recording_too(tmp_path: Path) -> None:
    """A log of which nothing has happened yet can be looked at."""
    sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)).close()

    summary = save_rrd(sl.read(tmp_path / "log"), tmp_path / "x.rrd")

    assert 0 == summary.events
    drawn = Drawn(tmp_path / "x.rrd")
    assert 1 == drawn.blueprints
    assert "/nothing" in drawn.entities


@pytest.mark.slow
def test_no_chunk_is_longer_than_rerun_likes(tmp_path: Path) -> None:
    """10,000 sightings of one door and 10,000 poses come in chunks of at most 4096 rows."""
    import rerun_cli

    states = [DoorState.OPEN, DoorState.CLOSED]
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=DoorId(1), x=0, y=0, theta=0, width=1)])
        for first in range(0, 10_000, 5_000):
            log.append([DoorObserved(door_id=DoorId(1), state=states[n % 2],
                                     happened_ns=START + (first + n) * 1000)
                        for n in range(5_000)])  # fmt: skip
            log.append([RobotPose(x=n / 100, y=0, theta=0, happened_ns=START + (first + n) * 1000)
                        for n in range(5_000)])  # fmt: skip

    drawn = recorded(sl.read(tmp_path / "log"), tmp_path)

    assert 4096 == drawn.most_rows
    assert 10_000 == len(drawn.rows("/map/robot/pose", "Arrows2D:origins"))
    binary = Path(rerun_cli.__file__).parent / "rerun"
    verified = subprocess.run(
        [binary, "rrd", "verify", tmp_path / "x.rrd"], capture_output=True, check=False
    )
    assert 0 == verified.returncode, verified.stderr


def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    """What was there stays whole, the error is the system's, and nothing is left lying about."""
    log = small_log(tmp_path / "log")
    rrd = tmp_path / "x.rrd"
    rrd.write_bytes(b"the old recording")
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    try:
        for most_bytes in (1_000, 20_000, 60_000):
            resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, unlimited[1]))
            with pytest.raises(SemmapError, match=r"x\.rrd: could not be written: File too large"):
                save_rrd(log, rrd)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
        signal.signal(signal.SIGXFSZ, handler)

    assert b"the old recording" == rrd.read_bytes()
    assert {"log", "x.rrd"} == {path.name for path in tmp_path.iterdir()}


def test_two_recordings_of_a_log_are_the_same_to_rerun(tmp_path: Path) -> None:
    """Nothing in the rows depends on when or where they were made."""
    log = small_log(tmp_path / "log")
    save_rrd(log, tmp_path / "a.rrd")
    save_rrd(log, tmp_path / "b.rrd")

    first, second = Drawn(tmp_path / "a.rrd"), Drawn(tmp_path / "b.rrd")

    assert first.statics == second.statics
    for entity in first.entities:
        for component in (STATE, STRIPS, SCALARS, "TextLog:text", "Arrows2D:origins"):
            assert first.rows(entity, component) == second.rows(entity, component)


def test_a_curve_goes_on_to_the_end(tmp_path: Path) -> None:
    """Probabilities that were given once hold on: a line to the last event, not a dot."""
    log = small_log(tmp_path / "log")

    drawn = recorded(log, tmp_path)

    *_, given, last = drawn.rows("/map/doors/front", SCALARS)
    assert (log.end_ns(), given[1]) == last
    (update,) = log.history(kinds=[DoorUpdated])
    assert given == (update.happened_ns, [0.5, 0.75])
    assert 3 == len(drawn.rows("/map/doors/front", SCALARS, "recorded"))


def test_lines_are_drawn_soon_after_the_floor(tmp_path: Path) -> None:
    """With WebGL what is drawn later is larger."""
    save_rrd(small_log(tmp_path / "log"), tmp_path / "x.rrd")

    statics = Drawn(tmp_path / "x.rrd").statics
    orders = [
        statics[path, f"{kind}:draw_order"]
        for path, kind in (
            ("/map/doors/front", "Points2D"), ("/map/floor", "Image"),
            ("/map/robot/track", "LineStrips2D"), ("/map/robot/pose", "Arrows2D"),
            ("/map/doors/front", "LineStrips2D"),
        )
    ]  # fmt: skip
    assert sorted(orders) == orders
