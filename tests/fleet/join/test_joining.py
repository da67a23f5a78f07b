"""Two robots of one building: what their logs are together, and what is refused."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.renumbering import robots_of, robots_of_poses
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import (
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    FloorMap,
    LevelAdded,
    PatrolStarted,
    RobotPose,
)
from semmap_log.errors import CorruptLogError, FormatError, LogAccessError, LogError, NewerLogError
from semmap_log.fleet.join import joined_logs, joining_logs
from semmap_log.fleet.shipping import ship
from semmap_log.log.replay.maintenance import recover, verify
from semmap_log.store.reading.segment_scan import open_segment
from tests.fleet.join.some_robots import (
    SECOND_NS,
    START_NS,
    SetClock,
    a_robot,
    doors_of,
    events_of,
    two_robots,
)
from tests.newer.logs import NewerLogs
from tests.store.eventful import flip
from tests.store.logs import segment_files


def test_doors_of_one_name_are_one_and_the_rest_say_whose_they_are(tmp_path: Path) -> None:
    """The latest sighting counts; who has no frame tells no geometry."""
    log = sl.join(two_robots(tmp_path))
    doors = doors_of(log)

    assert ["front", "tug1/store", "tug2/depot"] == sorted(doors)
    assert ("CLOSED", 1.0) == (doors["front"].state.name, doors["front"].x)
    assert not doors["tug2/depot"].is_placed
    assert ("tug1", "tug2") == robots_of(log.info.robot)
    assert {"tug1", "tug2", "tug2/camera"} == {entry.source for entry in log.history()}
    assert {"tug1", "tug2"} == {entry.actor for entry in log.history()}
    assert ["tug1", "tug2", "tug2/camera"] == sorted(
        {entry.source for entry in log.history("front")}
    )


def test_a_frame_turns_and_shifts(tmp_path: Path) -> None:
    """Doors and poses; the last writer of a shared door's place is who told it last."""
    tug1, tug2 = two_robots(tmp_path)
    with sl.append(tug2) as log:
        log.append(
            [RobotPose(x=1.0, y=0.0, theta=0.5, level=0, happened_ns=START_NS + 50 * SECOND_NS)]
        )

    joined = sl.join([tug1, tug2], frames={"tug2": (10.0, 20.0, math.pi / 2)})
    depot, front = (doors_of(joined)[name] for name in ("tug2/depot", "front"))
    (batch,) = joined.batches(kinds=[RobotPose])
    pose = batch[RobotPose][0]

    assert (9.0, 27.0) == pytest.approx((depot.x, depot.y))
    assert math.pi / 2 == pytest.approx(depot.theta)
    assert (8.0, 20.0) == pytest.approx((front.x, front.y))
    assert (10.0, 21.0, 0.5 + math.pi / 2) == pytest.approx((pose["x"], pose["y"], pose["theta"]))
    assert [1] == robots_of_poses(batch, robots_of(joined.info.robot)).tolist()
    assert [] == list(sl.join([tug1, tug2]).batches(kinds=[RobotPose]))


def join_file(folder: Path, *logs: Path) -> Path:
    """Write the definition of a join by hand."""
    told = {"format": "semmap-log join", "version": 1, "logs": [{"log": str(p)} for p in logs]}
    path = folder / "x.join.json"
    path.write_text(json.dumps(told), encoding="utf-8")
    return path


def visits_at_front(capsys: pytest.CaptureFixture[str], log: Path) -> int:
    with pytest.raises(SystemExit):
        main(["probabilities", str(log)])
    head, *rows = (line.split("\t") for line in capsys.readouterr().out.splitlines())
    (row,) = (dict(zip(head, row, strict=True)) for row in rows if "front" in row)
    return int(row["visits"])


def test_two_robots_at_one_door_are_two_visits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither names a source; without the prefix the second would be a look of the same visit."""
    logs = []
    for robot in ("tug1", "tug2"):
        clock = SetClock()
        with a_robot(tmp_path / robot, clock=clock) as log:
            front = log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="front")
            clock.now_ns += 60 * SECOND_NS + (robot == "tug2") * 5 * SECOND_NS
            log.observe(front, "open", accuracy=0.8)
        logs.append(tmp_path / robot)
    with a_robot(tmp_path / "one", clock=(clock := SetClock())) as log:
        front = log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="front")
        for wait in (60, 5):
            clock.now_ns += wait * SECOND_NS
            log.observe(front, "open", accuracy=0.8)

    joined = join_file(tmp_path, *logs)
    assert (2, 1) == (visits_at_front(capsys, joined), visits_at_front(capsys, tmp_path / "one"))


def test_levels_of_one_name_are_one_and_the_reference_draws_them(tmp_path: Path) -> None:
    """Another number of the same name becomes the reference's."""
    for number, robot in enumerate(("tug1", "tug2")):
        clock = SetClock(START_NS + number * SECOND_NS)
        with a_robot(tmp_path / robot, clock=clock) as log:
            log.append([LevelAdded(level=1 + number, name="ward")])
            log.append([LevelAdded(level=3, name=f"only {robot}")])
            cells = np.full((3, 4), 100 * number, np.int8)
            log.append([FloorMap(level=1 + number, resolution=0.5, origin_x=0.0, origin_y=0.0,
                                 cells=cells)])  # fmt: skip
            log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="front", level=1 + number)

    joined = sl.join([tmp_path / "tug1", tmp_path / "tug2"], frames={"tug2": (0.0, 0.0, 0.0)})
    state = joined.replay()

    assert {1: "ward", 3: "only tug1", 4: "only tug2"} == {
        number: level.name for number, level in state.levels.items()
    }
    assert ["front"] == list(doors_of(joined))
    plan = joined.floor_map("ward")
    assert plan is not None
    assert 0 == plan.cells.max()


def test_a_removal_counts_and_reaches_no_later_adding(tmp_path: Path) -> None:
    """The last of both decides; the log alone in which it was removed does not."""
    tug1, tug2 = two_robots(tmp_path)
    with sl.append(tug1, clock=SetClock(START_NS + 60 * SECOND_NS)) as log:
        log.remove_door("front")

    joined = sl.join([tug1, tug2])

    assert "front" not in doors_of(joined)
    assert "front" in doors_of(joined, at=f"@{(START_NS + 59 * SECOND_NS) / 10**9:.3f}")
    assert joined.timeline("front") is not None


@pytest.mark.parametrize(
    ("rows", "line", "problem"),
    [
        ("tug3,front,x", 2, "no log 'tug3' is joined; there are: tug1, tug2"),
        ("tug1,cellar,x", 2, "cellar"),
        ("tug1,store,x\ntug1,store,y", 3, "stands twice (line 2)"),
        ("tug1,store,x\ntug1,store,x", 3, "stands twice (line 2)"),
        ("tug1,store,x\ntug1,front,x", 3, "cannot both be 'x'"),
        ("tug1,,x", 2, "expected a log, a door and a building door"),
    ],
)
def test_a_wrong_table_names_its_line(rows: str, line: int, problem: str, tmp_path: Path) -> None:
    """Nothing is joined by half."""
    table = tmp_path / "m.csv"
    table.write_text(f"log,door,building door\n{rows}\n", encoding="utf-8")

    with pytest.raises(FormatError) as raised:
        sl.join(two_robots(tmp_path), doors=table)

    assert f"m.csv:{line}: " in str(raised.value)
    assert problem in str(raised.value)


def test_the_table_joins_doors_of_other_names(tmp_path: Path) -> None:
    """By name or id; the building's name is the only one then."""
    rows = [("tug1", "store", "storage"), ("tug2", "id:1", "storage")]
    log = sl.join(two_robots(tmp_path), doors=rows)

    assert ["front", "storage"] == sorted(doors_of(log))
    assert 5.0 == doors_of(log)["storage"].x
    assert ["tug1", "tug2"] == sorted({e.source for e in log.history("storage")})


def test_retractions_reach_their_own_log_only(tmp_path: Path) -> None:
    """Events 1..2 of one log are other events of the view."""
    tug1, tug2 = two_robots(tmp_path)
    with sl.append(tug2, clock=SetClock(START_NS + 90 * SECOND_NS)) as log:
        log.retract(log.last_event())

    joined = sl.join([tug1, tug2])

    assert "OPEN" == doors_of(joined)["front"].state.name
    assert ["tug2/camera"] == [e.source for e in joined.history() if e.retracted]


def test_forks_of_one_log_are_refused_and_copies_are_not(tmp_path: Path) -> None:
    """A copy that is behind is a part of the other."""
    tug1, tug2 = two_robots(tmp_path)
    copy = Path(shutil.copytree(tug1, tmp_path / "copy"))
    with sl.append(tug1, clock=SetClock(START_NS + 40 * SECOND_NS)) as log:
        log.observe("front", "open")

    assert events_of(sl.join([tug1, tug2])) == events_of(sl.join([copy, tug2, tug1]))

    with sl.append(copy, clock=SetClock(START_NS + 41 * SECOND_NS)) as log:
        log.observe("front", "closed")
        log.observe("front", "open")
    with pytest.raises(LogError, match="forks of one log"):
        sl.join([copy, tug2, tug1])


def test_a_live_log_counts_up_to_its_last_commit_and_a_damaged_one_is_named(tmp_path: Path) -> None:
    """What is wrong with one log is told by its path."""
    tug1, tug2 = two_robots(tmp_path)
    with sl.append(tug1, clock=SetClock(START_NS + 70 * SECOND_NS)) as log:
        log.observe("front", "open")
        assert "OPEN" == doors_of(sl.join([tug1, tug2]))["front"].state.name
    (segment,) = segment_files(tug2)
    data = bytearray(segment.read_bytes())
    for place in range(len(data) // 3, len(data) // 2):
        data[place] ^= 0xFF
    segment.write_bytes(data)

    with pytest.raises((CorruptLogError, LogError), match="tug2"):
        sl.join([tug1, tug2])


def test_what_a_later_version_wrote_may_touch_the_answer(newer: NewerLogs, tmp_path: Path) -> None:
    """Then nothing is joined."""
    tug1, _ = two_robots(tmp_path)
    (tmp_path / "new").mkdir()
    with pytest.raises(NewerLogError, match="newer version"):
        sl.join([tug1, newer.log("locked", tmp_path / "new")])


def test_the_view_is_kept_and_made_again_where_a_log_grew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unchanged logs are looked at by their heads alone."""
    tug1, tug2 = two_robots(tmp_path)
    first = events_of(sl.join([tug1, tug2], cache=tmp_path / "cache"))
    with monkeypatch.context() as patched:
        patched.setattr(joining_logs, "build_join", None)
        assert first == events_of(sl.join([tug2, tug1], cache=tmp_path / "cache"))
    with sl.append(tug1, clock=SetClock(START_NS + 70 * SECOND_NS)) as log:
        log.observe("front", "open")

    again = events_of(sl.join([tug1, tug2], cache=tmp_path / "cache"))

    assert len(first) + 1 == len(again)
    assert 2 == len(list((tmp_path / "cache" / "joined").iterdir()))


def test_a_log_in_a_store_is_joined_where_it_lies(bucket: str, tmp_path: Path) -> None:
    """And its copy on the disk is the same log."""
    tug1, tug2 = two_robots(tmp_path)
    ship(tug2, UrlPath(f"{bucket}/tug2"))

    expected = events_of(sl.join([tug1, tug2]))

    assert expected == events_of(sl.join([tug1, f"{bucket}/tug2"]))
    assert expected == events_of(sl.join([tug1, f"{bucket}/tug2", tug2]))


def test_a_join_of_joins_is_the_join_of_all(tmp_path: Path) -> None:
    """Whatever the brackets are."""
    tug1, tug2 = two_robots(tmp_path)
    with a_robot(tmp_path / "tug3", clock=SetClock(START_NS + 3 * SECOND_NS)) as log:
        log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="depot")
    third = tmp_path / "tug3"
    for name, places in (("ab", [tug1, tug2]), ("bc", [tug2, third])):
        told = {
            "format": "semmap-log join",
            "version": 1,
            "logs": [{"log": str(p)} for p in places],
        }
        (tmp_path / f"{name}.join.json").write_text(json.dumps(told), encoding="utf-8")

    expected = events_of(sl.join([tug1, tug2, third]))

    assert expected == events_of(sl.join([tmp_path / "ab.join.json", third]))
    assert expected == events_of(sl.join([tug1, tmp_path / "bc.join.json"]))


def test_a_join_cannot_be_written_to_or_shipped(tmp_path: Path) -> None:
    """It has no bytes of its own."""
    tug1, _ = two_robots(tmp_path)
    path = join_file(tmp_path, tug1)

    assert repr(sl.read(path).replay()) == repr(sl.read(tug1).replay())
    for write in (sl.append, lambda one: ship(one, UrlPath("s3://nowhere/x"))):
        with pytest.raises(LogAccessError, match="can only be read"):
            write(path)


def test_two_commands_of_one_id_stay_two(tmp_path: Path) -> None:
    """A goal that two robots were given; the view is a good log."""
    for number, robot in enumerate(("tug1", "tug2")):
        with a_robot(tmp_path / robot, clock=SetClock(START_NS + number * SECOND_NS)) as log:
            log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="front", command_id=bytes(16))
    view = joining_logs.JoinedView(
        joined_logs.open_joined(
            joining_logs.defined([tmp_path / "tug1", tmp_path / "tug2"], frames={})
        ),
        None,
    )

    assert 0 == verify(view.path).exit_code
    assert 2 == len({c.command_id for c in sl.read(view.path).commits()})


def test_rounds_of_two_robots_stay_two(tmp_path: Path) -> None:
    """Each counts its own from 1 on."""
    for number, robot in enumerate(("tug1", "tug2")):
        with a_robot(tmp_path / robot, clock=SetClock(START_NS + number * SECOND_NS)) as log:
            log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="front")
            log.start_patrol()
    batches = sl.join([tmp_path / "tug1", tmp_path / "tug2"]).batches(kinds=[PatrolStarted])

    assert [1, 2] == [n for batch in batches for n in batch[PatrolStarted]["patrol"].tolist()]


def test_events_as_columns_are_those_one_by_one(tmp_path: Path) -> None:
    """A large batch of sightings keeps its values."""
    tug1, tug2 = two_robots(tmp_path)
    with sl.append(tug2, clock=SetClock(START_NS + 80 * SECOND_NS)) as log:
        times = START_NS + np.arange(500) * 10**6 + 60 * SECOND_NS
        log.append([EventBatch.of(DoorObserved, door_id=2, state=1, happened_ns=times)])
    joined = sl.join([tug1, tug2])

    seen = [e for e in joined.history("front") if isinstance(e.event, DoorObserved)]
    assert times.tolist() == [e.happened_ns for e in seen[-500:]]


def test_a_name_that_one_log_has_twice_joins_nothing(tmp_path: Path) -> None:
    """Nobody knows which of the two is meant."""
    tug1, tug2 = two_robots(tmp_path)
    with sl.append(tug2, clock=SetClock(START_NS + 40 * SECOND_NS)) as log:
        again = DoorId(9)
        log.append(
            [
                DoorAdded(door_id=again, level=0),
                DoorAnnotated(door_id=again, key="name", value="front"),
            ]
        )

    names = [door.label for door in sl.join([tug1, tug2]).replay().doors.values()]

    assert 2 == names.count("tug2/front")
    assert 1 == names.count("tug1/front")


@pytest.mark.parametrize("is_removed", [False, True])
def test_another_s_later_adding_wipes_no_state_and_brings_a_door_back(
    is_removed: bool, tmp_path: Path
) -> None:
    """Who adds a door that was there all the time knows nothing of its state."""
    tug1, _ = two_robots(tmp_path)
    if is_removed:
        with sl.append(tug1, clock=SetClock(START_NS + 15 * SECOND_NS)) as log:
            log.remove_door("front")
    with a_robot(tmp_path / "tug3", clock=SetClock(START_NS + 20 * SECOND_NS)) as log:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, name="front")

    front = doors_of(sl.join([tug1, tmp_path / "tug3"]))["front"]

    assert ("OPEN", 1.0) == (front.state.name, front.x)


@pytest.mark.parametrize("lost", [1, 2])
def test_events_of_a_door_whose_adding_is_lost_are_no_other_door_s(
    tmp_path: Path, lost: int
) -> None:
    """Of a log that was damaged and recovered: in its own map there is no such door."""
    path, clock = tmp_path / "tug1", SetClock()
    with a_robot(path, clock=clock) as log:
        for x in (1.0, 2.0):
            clock.now_ns += SECOND_NS
            log.add_door(x=x, y=2.0, theta=0.0, width=0.9, name=f"at {x}", state="closed")
        clock.now_ns += SECOND_NS
        log.observe(DoorId(lost), "open")
        log.append([DoorObserved(door_id=DoorId(d), state=sl.DoorState.OPEN) for d in (lost, lost)])
        log.annotate(DoorId(lost), "looked at", "yes")
        log.update_door(DoorId(lost), width=2.0)
    (file,) = segment_files(path)
    flip(file, open_segment(file).chunks[lost].data_offset + 40)
    recover(path)

    joined = sl.join({"tug1": path})

    (door,) = joined.replay().doors.values()
    assert (f"at {3.0 - lost}", "CLOSED") == (door.name, door.state.name)
    assert repr(door) == repr(next(iter(sl.read(path).replay().doors.values())))


def test_one_log_alone_keeps_who_told_and_floor_maps_that_were_taken_back(tmp_path: Path) -> None:
    """Event by event; a sensor without a name is no sensor called as the robot."""
    with a_robot(tmp_path / "tug1") as log:
        door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front", actor="anna")
        cells = np.zeros((3, 4), np.int8)
        plan = FloorMap(level=0, resolution=0.1, origin_x=0.0, origin_y=0.0, cells=cells)
        log.retract(log.append([plan]).commit.last_event)
        log.observe(door, "open", source="camera")
        log.observe(door, "open")

    alone, joined = sl.read(tmp_path / "tug1"), sl.join({"tug1": tmp_path / "tug1"})

    mine, theirs = (
        [(repr(entry.event), entry.actor, entry.source) for entry in log.history()]
        for log in (alone, joined)
    )
    assert mine == theirs
    assert {"", "camera"} == {source for _, _, source in mine}
