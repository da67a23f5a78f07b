"""Objects in logs that are cared for, exported without names, joined, and followed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.core.model.events import DoorAnnotated
from semmap_log.errors import LogError
from semmap_log.fleet.join.joining_logs import join
from semmap_log.interop.exporting.log_files import write_event_lines
from semmap_log.interop.importing.importing import import_file
from semmap_log.interop.pseudonyms.pseudonymous_log import pseudonymous
from semmap_log.log.replay.maintenance import copy, recover, verify
from semmap_log.log.replay.replay import Scope
from semmap_log.log.trimming.redaction import Annotation, Redaction
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.fleet.join.some_robots import START_NS, SetClock, a_robot
from tests.objects.conftest import furnish

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")


def what(log: sl.DoorLog) -> dict[str, tuple[str, str, int]]:
    doors = log.replay().doors.values()
    return {d.label: (d.object_class.name, d.state_word, len(d.outline)) for d in doors}


FURNISHED = {
    "front": ("door", "OPEN", 0), "west": ("dock", "free", 0), "bay": ("shutter", "CLOSED", 0),
    "spill 4": ("spill", "wet", 3),
}  # fmt: skip


@pytest.fixture
def closed(log: sl.DoorLogWriter, path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 20)
    for _ in range(50):
        log.observe("west", "free")
    log.close()
    return path


def test_what_an_object_is_stays_when_the_past_goes(closed: Path) -> None:
    """Retention takes sightings and changes; classes, and which object is of which, stay."""
    trim_log(closed, Retention(LogReader(closed), LogReader(closed).last_log_time_ns()))

    log = sl.read(closed)
    assert log.horizon()
    assert FURNISHED == what(log)
    assert 0 == verify(closed).exit_code


@pytest.mark.parametrize("key", ["class", "outline"])
def test_what_makes_an_object_what_it_is_is_not_redacted(closed: Path, key: str) -> None:
    """Else it would be read as a door. In a log without classes it is a word as any other."""
    reader = LogReader(closed)
    with pytest.raises(LogError, match=f"annotations '{key}' of door 4 say what it is and where"):
        Redaction.of(reader, [Annotation(4, key)], 99)


def test_a_word_of_a_door_is_redacted(tmp_path: Path) -> None:
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="front")
        log.annotate("front", "class", "Anna's")

    trim_log(
        tmp_path / "log", Redaction.of(LogReader(tmp_path / "log"), [Annotation(1, "class")], 9)
    )

    assert {"name": "front"} == sl.read(tmp_path / "log").replay().doors[sl.DoorId(1)].annotations


def test_copies_and_what_is_recovered_know_them(closed: Path, tmp_path: Path) -> None:
    copy(closed, tmp_path / "copy")
    assert FURNISHED == what(sl.read(tmp_path / "copy"))

    segment = max(closed.glob("*.mcap"))
    data = bytearray(segment.read_bytes())
    data[-200] ^= 255
    segment.write_bytes(data)
    recover(closed)
    assert FURNISHED == what(sl.read(closed))


def test_exported_lines_make_the_same_objects(closed: Path, tmp_path: Path) -> None:
    write_event_lines(sl.read(closed), tmp_path / "office.jsonl", Scope())

    with sl.create(tmp_path / "again", tz="UTC", clock=SteadyClock(2 * 10**18)) as again:
        import_file(again, tmp_path / "office.jsonl")

    assert FURNISHED == what(sl.read(tmp_path / "again"))


def test_pseudonyms_leave_objects_what_they_are(closed: Path) -> None:
    """Under numbers: neither the names of classes nor their words are told."""
    with sl.append(closed) as log:
        for key in ("class", "outline"):
            log.append([DoorAnnotated(door_id=sl.DoorId(1), key=key, value="Anna's own")])
    with pseudonymous(sl.read(closed), Scope()) as (told, names):
        doors = told.replay()
        lines = [json.dumps(repr(entry.event)) for entry in told.history()]

    assert {1: "door", 2: "class-1", 3: "class-2", 4: "class-3"} == {
        int(i): door.object_class.name for i, door in doors.doors.items()
    }
    assert 3 == len(doors.doors[sl.DoorId(4)].outline)
    assert ["point", "segment", "polygon"] == [c.geometry.value for c in doors.classes.values()]
    assert not [word for word in ("dock", "spill", "taken", "wet", "Anna")
                if any(word in line for line in lines)]  # fmt: skip
    assert not names.left_out
    assert () == doors.doors[sl.DoorId(1)].outline


def test_pseudonyms_of_classes_that_come_and_go(log: sl.DoorLogWriter, path: Path) -> None:
    """A class that is said before it is defined, one that is taken back."""
    log.append([DoorAnnotated(door_id=sl.DoorId(1), key="class", value="gate")])
    log.define_class("gate")
    for door, word in ((2, ""), (3, "door"), (4, "somebody's")):
        log.append([DoorAnnotated(door_id=sl.DoorId(door), key="class", value=word)])
    log.close()

    with pseudonymous(sl.read(path), Scope()) as (told, _):
        assert [False, True, True, True] == [
            door.object_class.is_door for door in told.replay().doors.values()
        ]


def test_a_dock_is_no_door_of_its_name(tmp_path: Path) -> None:
    """Of two robots' logs: the door and the dock `west` stay two; docks of one name are one."""
    with a_robot(tmp_path / "tug1") as log:
        furnish(log)
    with a_robot(tmp_path / "tug2", clock=SetClock(START_NS + 1)) as log:
        log.define_class("dock", geometry="point", states="free,taken", blocks="taken")
        log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="bay")
        log.add_door(object_class="dock", x=4.0, y=2.0, name="west")
        log.observe("west", "taken")

    both = join([tmp_path / "tug1", tmp_path / "tug2"])

    assert ("dock", "taken", 0) == what(both)["west"]
    assert {"shutter", "door"} == {of for name, (of, _, _) in what(both).items() if "bay" in name}
    assert 5 == len(what(both))
    assert ("spill", "wet", 3) in what(both).values()


def test_classes_of_one_name_that_are_not_one_stay_two(tmp_path: Path) -> None:
    """Each robot's docks are as it says, under the robot's name."""
    with a_robot(tmp_path / "tug1") as log:
        furnish(log)
    with a_robot(tmp_path / "tug2", clock=SetClock(START_NS + 1)) as log:
        log.define_class("dock", states="ok,bad")
        log.define_class("spill", geometry="polygon", states="dry,wet", blocks="wet")
        log.add_door(object_class="dock", name="west", x=9.0, y=9.0, theta=0.0, width=1.0,
                     state="bad")  # fmt: skip

    found = what(join([tmp_path / "tug1", tmp_path / "tug2"]))

    assert ("tug1.dock", "free", 0) == found["tug1/west"]
    assert ("tug2.dock", "bad", 0) == found["tug2/west"]
    assert ("spill", "wet", 3) in found.values()
