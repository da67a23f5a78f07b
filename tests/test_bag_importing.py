"""Bags into a log: what a robot knew is there again, whole or not at all, and only once."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag2 import Writer

import semmap_log as sl
from semmap_log.core.model.doors import reduced
from semmap_log.core.model.events import LevelAdded, RobotPose
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError, FormatError
from semmap_log.interop.formats.ros.ros_types import RMF_DOOR_STATE, ros_types
from semmap_log.interop.importing import bag_importing
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.topics.topic_rules import WELL_KNOWN
from tests.interop.exporting.lively import END, lively_log
from tests.interop.formats.bags.bags_of_others import (
    Said,
    write_mcap,
    write_ros1,
    write_ros2,
    write_with_rosbag,
)
from tests.interop.topics.robots import START, Robot, S
from tests.verbs import run
from tests.views.rerun.some_logs import START as LIVELY_START

ROBOT = Robot()


@pytest.fixture
def office(tmp_path: Path) -> Path:
    sl.create(tmp_path / "office", tz="UTC").close()
    return tmp_path / "office"


def _import(office: Path, path: Path, **options: Any) -> Any:
    with sl.append(office) as log:
        return import_file(log, path, ImportOptions(**options))


def test_states_of_doors_on_several_levels_need_no_level(office: Path, tmp_path: Path) -> None:
    """Where each name is there once. One that would be new needs one, and is passed over aloud."""
    with sl.append(office) as log:
        log.append([LevelAdded(level=n, name=name) for n, name in ((1, "ground"), (2, "upper"))])
        for level, name in ((1, "lab"), (2, "attic")):
            log.add_door(name=name, level=level, at=START - S)
    names = ("lab", " attic ", "shed")
    said = [Said("door_states", *ROBOT.door_state(name, 2), START) for name in names]
    write_mcap(tmp_path / "day.mcap", said)

    plan = _import(office, tmp_path / "day.mcap").plan

    doors = sl.read(office).replay().doors.values()
    assert [("lab", "OPEN"), ("attic", "OPEN")] == [(door.name, door.state.name) for door in doors]
    (warning,) = plan.warnings
    assert "a new door, and no level for it; passed over: 'shed'" in warning
    _import(office, tmp_path / "day.mcap", level="upper")
    assert ["lab", "attic", "shed"] == [d.name for d in sl.read(office).replay().doors.values()]


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (None, "the topics that are read have no messages"),
        (ROBOT.transforms(("world", "cart", 1.0, 2.0, 0.0)), "no transform from map to base_link"),
        (ROBOT.door_state("", 2), "a door without a name; passed over"),
    ],
)
def test_a_bag_of_which_nothing_is_taken_is_told(
    office: Path, tmp_path: Path, said: tuple[str, bytes] | None, why: str,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Why, and exit code 1; not that the log holds it already."""
    read_as = "tf" if said and said[0].startswith("tf2") else "rmf_door_state"
    (tmp_path / "robot.yaml").write_text(f"topics: {{/s: {read_as}}}")
    if said is None:
        with Writer(tmp_path / "day", version=9) as writer:
            writer.add_connection("/s", RMF_DOOR_STATE, typestore=ros_types(2))
    else:
        write_ros2(tmp_path / "day", [Said("/s", *said, START)])

    assert 1 == run("import", office, tmp_path / "day", "--mapping", tmp_path / "robot.yaml")
    err = capsys.readouterr().err
    assert "day: nothing of it can be imported: " in err
    assert why in err
    assert -1 == sl.read(office).last_event()


def _seen(log: sl.DoorLog, at_ns: int) -> list[Any]:
    """Return what a DoorMap can say of the doors at a moment."""
    return [
        (d.door_id, d.x, d.y, d.theta, d.width, reduced(d.state), str(d.prob_open),
         str(d.prob_closed))
        for d in log.replay(at=at_ns).doors.values()
        if d.is_placed
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ["day.mcap", "day.bag", "day"])
@pytest.mark.parametrize("seed", [1, 2])
def test_what_was_exported_comes_back(name: str, seed: int, office: Path, tmp_path: Path) -> None:
    """The same doors at the same moments, in all that a DoorMap carries."""
    lively = lively_log(tmp_path / "lively", seed=seed)
    assert 0 == run("export", lively.path, tmp_path / name, "--markers")

    _import(office, tmp_path / name)

    back, rng = sl.read(office), random.Random(seed)
    for _ in range(200):
        at_ns = rng.randrange(LIVELY_START - S, END + S)
        assert _seen(lively, at_ns) == _seen(back, at_ns)
    for level in (1, 2):
        theirs, ours = lively.floor_map(level), back.floor_map(level)
        assert theirs is not None
        assert ours is not None
        assert (theirs.cells == ours.cells).all()
    assert 20 < sum(len(batch) for batch in back.batches(kinds=[RobotPose]))


def test_a_bag_by_ros_1s_own_library_is_recorded_as_its_robot_meant_it(
    office: Path, tmp_path: Path
) -> None:
    """Open-RMF's doors, a contact by a mapping, the map: with happened times of the bag."""
    robot = Robot(1)
    said = [
        Said("/door_states", *robot.door_state("front", 2), START),
        Said("/contact", *robot.said("Bool", True), START + S),
        Said("/contact", *robot.said("Bool", False), START + 2 * S),
        Said("/chatter", *robot.said("String", "hello"), START + 3 * S),
    ]
    write_with_rosbag(tmp_path / "day.bag", said)
    mapping = tmp_path / "robot.yaml"
    mapping.write_text(
        "topics: {/contact: {read: sensor, door: back, accuracy: 0.9}}\nwell_known: true"
    )

    imported = _import(office, tmp_path / "day.bag", mapping=mapping)

    log = sl.read(office)
    states = [
        [(door.name, door.state.name) for door in log.replay(at=START + n * S).doors.values()]
        for n in range(3)
    ]
    assert [
        [("front", "OPEN")],
        [("front", "OPEN"), ("back", "OPEN")],
        [("front", "OPEN"), ("back", "CLOSED")],
    ] == states
    assert ("/chatter (std_msgs/String)",) == imported.plan.left_out
    assert ["day.bag"] == [entry.source for entry in log.history()][:1]
    assert 1 == len(list(log.commits()))


def test_the_same_bag_changes_nothing_but_with_another_mapping_it_may(
    office: Path, tmp_path: Path
) -> None:
    """The command id is made of the bag's and the mapping's bytes."""
    write_mcap(tmp_path / "x.mcap", [Said("/s", *ROBOT.door_state("front", 2), START)])
    mapping = tmp_path / "m.yaml"
    mapping.write_text("topics: {/s: {read: rmf_door_state, doors: {front: back}}}")

    first = _import(office, tmp_path / "x.mcap")
    again = _import(office, tmp_path / "x.mcap")
    other = _import(office, tmp_path / "x.mcap", mapping=mapping)
    write_mcap(tmp_path / "x.mcap", [Said("/s", *ROBOT.door_state("front", 0), START + S)])
    later = _import(office, tmp_path / "x.mcap")

    known = [each.known_before for each in (first, again, other, later)]
    assert [False, True, False, False] == known
    names = [door.name for door in sl.read(office).replay().doors.values()]
    assert ["front", "back"] == names


def test_a_bag_that_is_damaged_leaves_the_log_as_it_is(office: Path, tmp_path: Path) -> None:
    """Whole or not at all, also where the first half could be read."""
    said = [Said("/s", *ROBOT.door_state(f"door{n}", 2), START + n * S) for n in range(400)]
    write_mcap(tmp_path / "x.mcap", said)
    data = bytearray((tmp_path / "x.mcap").read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "x.mcap").write_bytes(data)

    with pytest.raises(FormatError, match=r"x\.mcap: damaged"):
        _import(office, tmp_path / "x.mcap")

    assert [] == list(sl.read(office).commits())


def test_many_events_are_read_twice_and_not_kept(
    office: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And are the same as if they had been."""
    said = [Said("/s", *ROBOT.door_state(f"door{n}", 2), START + n * S) for n in range(50)]
    write_mcap(tmp_path / "x.mcap", said)
    monkeypatch.setattr(bag_importing, "MOST_KEPT", 10)

    imported = _import(office, tmp_path / "x.mcap")

    assert not isinstance(imported.plan.events, list)
    assert 150 == imported.plan.count
    assert [f"door{n}" for n in range(50)] == [
        door.name for door in sl.read(office).replay().doors.values()
    ]


def test_a_bag_that_is_another_at_the_second_reading_is_told(
    office: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its recorder still writes: a commit would say that it holds what it does not."""
    said = [Said("/s", *ROBOT.door_state(f"door{n}", 2), START + n * S) for n in range(50)]
    write_mcap(tmp_path / "x.mcap", said)
    monkeypatch.setattr(bag_importing, "MOST_KEPT", 10)
    plan = bag_importing.plan_bag(tmp_path / "x.mcap", sl.read(office), WELL_KNOWN)

    write_mcap(tmp_path / "x.mcap", said[:-1])

    with pytest.raises(FormatError, match=r"x\.mcap: it changed while it was imported"):
        list(plan.events)


def test_what_cannot_be_is_told_with_counts(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On stderr, once for each kind, and who asked for doors is left out aloud."""
    said = [Said("/amcl_pose", *ROBOT.pose(1, 2, 3, frame="odom"), START + n) for n in range(3)]
    said += [Said("/r", *ROBOT.door_request("front", 2, "tug1"), START + S)]
    write_mcap(tmp_path / "x.mcap", said)

    assert 0 == run("import", office, tmp_path / "x.mcap")

    err = capsys.readouterr().err
    assert "warning: /amcl_pose: a pose in another frame than map; passed over: 'odom' (3 t" in err
    assert "warning: messages that say who: 1; an import is one commit, with one note" in err


def test_a_bag_without_a_topic_that_is_read_is_told(office: Path, tmp_path: Path) -> None:
    write_mcap(tmp_path / "x.mcap", [Said("/chatter", *ROBOT.said("String", "x"), START)])

    with pytest.raises(FormatError, match=r"there is: /chatter \(std_msgs/String\).*--mapping"):
        _import(office, tmp_path / "x.mcap")


def test_a_level_has_to_be_said_where_there_are_several(office: Path, tmp_path: Path) -> None:
    """Else doors and robot would be put on any."""
    with sl.append(office) as log:
        log.append([LevelAdded(level=n, name=f"L{n}") for n in (1, 2)])
    write_mcap(tmp_path / "x.mcap", [Said("/doors", *ROBOT.door_map([{"door_id": 1}]), START)])
    mapping = tmp_path / "m.yaml"
    mapping.write_text("topics: {/doors: {read: door_map, level: L2}}")

    with pytest.raises(
        CommandError, match=r"/doors: the log has several levels: .* a mapping file says"
    ):
        _import(office, tmp_path / "x.mcap")
    _import(office, tmp_path / "x.mcap", mapping=mapping)
    assert [2] == [door.level for door in sl.read(office).replay().doors.values()]


def test_a_dry_run_shows_events_and_writes_nothing(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Lines as `record` takes them; the log stays as it is, byte for byte."""
    write_ros1(tmp_path / "x.bag", [Said("/s", *Robot(1).door_state("front", 2), START)])
    before = {path: path.read_bytes() for path in office.iterdir()}

    assert 0 == run("import", office, tmp_path / "x.bag", "--dry-run")

    captured = capsys.readouterr()
    lines = [json.loads(line) for line in captured.out.splitlines()]
    assert ["DoorAdded", "DoorAnnotated", "DoorObserved"] == [line["kind"] for line in lines]
    assert "nothing was written" in captured.err
    assert before == {path: path.read_bytes() for path in office.iterdir()}


def test_a_dry_run_of_a_bag_that_was_imported_shows_nothing(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As the import itself would make nothing."""
    write_ros1(tmp_path / "x.bag", [Said("/s", *Robot(1).door_state("front", 2), START)])
    _import(office, tmp_path / "x.bag")

    assert 0 == run("import", office, tmp_path / "x.bag", "--dry-run")

    captured = capsys.readouterr()
    assert "" == captured.out
    assert "imported before; nothing would be made" in captured.err


@pytest.mark.parametrize(
    ("name", "text", "kinds"),
    [
        ("doors.csv", "timestamp,door,state\n@1,front,open\n",
         ["DoorAdded", "DoorAnnotated", "DoorUpdated"]),
        ("doors.yaml", "1: {position: {x: 0, y: 0, theta: 0}, width: 1}", ["DoorAdded"]),
        ("doors.jsonl", '{"kind": "DoorAdded", "level": 0}\n', ["DoorAdded"]),
    ],
)  # fmt: skip
def test_a_dry_run_is_of_any_file(
    office: Path, tmp_path: Path, *, capsys: pytest.CaptureFixture[str], name: str, text: str,
    kinds: list[str],
) -> None:  # fmt: skip
    """Its events are shown, and nothing is written; the log may be somebody's who writes."""
    (tmp_path / name).write_text(text)

    with sl.append(office):
        assert 0 == run("import", office, tmp_path / name, "--dry-run")

    out, err = capsys.readouterr()
    assert kinds == [json.loads(line)["kind"] for line in out.splitlines()]
    assert f"{name}: {counted(len(kinds), 'event')}; nothing was written." in err
    assert [] == list(sl.read(office).commits())
    assert 0 == run("import", office, tmp_path / name)
    assert 0 == run("import", office, tmp_path / name, "--dry-run")
    assert "imported before; nothing would be made" in capsys.readouterr().err


def test_progress_is_told_in_messages(tmp_path: Path, office: Path) -> None:
    """How many were read, of how many."""
    said = [Said("/s", *ROBOT.door_state("front", 2), START + n * S) for n in range(2500)]
    write_mcap(tmp_path / "x.mcap", said)
    told: list[tuple[int, int]] = []

    with sl.append(office) as log:
        import_file(
            log, tmp_path / "x.mcap", progress=lambda done, total: told.append((done, total))
        )

    assert [(1000, 2500), (2000, 2500)] == told[:2]


@pytest.mark.parametrize(
    "options",
    [
        ImportOptions(at_ns=START),
        ImportOptions(update=True),
        ImportOptions(renumber=True),
        ImportOptions(windows=Path("windows.csv")),
    ],
)
def test_options_that_mean_nothing_of_a_bag_are_refused(
    options: ImportOptions, tmp_path: Path
) -> None:
    """Nothing is passed over in silence."""
    (tmp_path / "windows.csv").touch()
    with sl.create(tmp_path / "log", tz="UTC") as log:
        write_mcap(tmp_path / "x.mcap", [Said("/d", *Robot(2).door_map([{"door_id": 1}]), START)])
        windows = tmp_path / "windows.csv" if options.windows else None

        with pytest.raises(CommandError, match=r"x\.mcap: a bag's .* leave out --windows"):
            import_file(log, tmp_path / "x.mcap", replace(options, windows=windows))

        assert 0 == len(log.replay())


def test_a_mapping_of_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    """Whoever gives one expects it to count."""
    (tmp_path / "doors.yaml").write_text("{}\n")

    with (
        sl.create(tmp_path / "log", tz="UTC") as log,
        pytest.raises(CommandError, match=r"doors\.yaml: --mapping is only for bags"),
    ):
        import_file(log, tmp_path / "doors.yaml", ImportOptions(mapping=tmp_path / "mapping.yaml"))
