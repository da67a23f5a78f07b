"""A log that is exported as JSON lines and imported is the same log, whatever it is asked."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorObserved, DoorRemoved, Retracted
from semmap_log.errors import FormatError
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.formats.json.door_json import entry_to_json
from semmap_log.interop.importing.import_plan import Imported
from semmap_log.interop.importing.importing import import_file
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.replay.replay import Scope
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock
from tests.interop.exporting.random_logs import LATER_NS, random_log

RECORDINGS = Path(__file__).resolve().parents[3] / "recordings"


def lines_of(log: Path, scope: Scope = Scope()) -> Path:
    """Export a log beside it; return the file."""
    out = log.parent / f"{log.name}.jsonl"
    export(sl.read(log), out, scope)
    return out


def taken_in(path: Path, file: Path, tz: str = "Europe/Vienna") -> Imported:
    """Import a file into a log, which is made if it is not there."""
    if not path.exists():
        with sl.create(path, tz=tz, clock=SteadyClock(LATER_NS), compact=False):
            pass
    with sl.append(path, clock=SteadyClock(LATER_NS + 10**15), compact=False) as log:
        return import_file(log, file)


def copied(log: Path) -> Path:
    """Return a new log of what is exported of one."""
    copy = log.parent / "copy"
    taken_in(copy, lines_of(log))
    return copy


def commits(log: sl.DoorLog) -> list[Any]:
    return [(c.first_event, c.count, c.recorded_ns, c.closed_ns, c.command_id, c.content, c.note)
            for c in log.commits()]  # fmt: skip


def door_table(log: sl.DoorLog, **moment: Any) -> str:
    """Return the doors and levels, without the salts of their texts."""
    door_map = log.replay(**moment)
    return repr((door_map.doors, door_map.levels, door_map.event))


def history(log: sl.DoorLog) -> list[str]:
    """Return what a history says, and the events themselves but for fields that mean nothing."""
    return [
        repr((entry_to_json(entry), None if entry.kind == "DoorUpdated" else entry.event))
        for entry in log.history()
    ]


def moments(log: sl.DoorLog, count: int) -> list[tuple[int, int, int]]:
    """Return happened times, recorded times and numbers to ask for."""
    events = [event for batch in log.batches(retracted=True) for event in batch]
    chosen = random.Random(5).sample(events, min(count, len(events)))
    return [(event.event.happened_ns or 0, event.recorded_ns, event.number) for event in chosen]


def assert_same_answers(log: sl.DoorLog, copy: sl.DoorLog, count: int) -> None:
    assert commits(log) == commits(copy)
    assert history(log) == history(copy)
    assert door_table(log) == door_table(copy)
    asked = moments(log, count)
    for (at, known_at, event), (other_at, _, _) in zip(asked, reversed(asked), strict=True):
        for scope in ({"at": at}, {"known_at": known_at}, {"event": event},
                      {"at": other_at, "known_at": known_at}):  # fmt: skip
            assert door_table(log, **scope) == door_table(copy, **scope)


@pytest.mark.parametrize("seed", range(5))
def test_a_random_log_comes_back_as_it_was(seed: int, tmp_path: Path) -> None:
    """Every question has the same answer at every moment."""
    path = random_log(tmp_path / "log", seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", 4)
        copy = copied(path)
    log, other = sl.read(path), sl.read(copy)

    assert_same_answers(log, other, count=8)
    assert lines_of(path).read_bytes() == lines_of(copy).read_bytes()
    assert () == verify(copy).findings
    assert [] == other.summary().suspects


def test_a_log_in_another_zone_says_so(tmp_path: Path) -> None:
    """The instants are the same; which days they are on is not. In one zone nothing is said."""
    with sl.create(tmp_path / "log", tz="Asia/Tokyo") as log:
        log.add_door(at="2026-03-02T07:00")
        log.add_door(at="2026-03-02T08:00")
    lines = lines_of(tmp_path / "log")
    texts = [json.loads(line) for line in lines.read_text().splitlines()]
    assert ["Asia/Tokyo", None] == [line.get("timezone") for line in texts]

    told = {}
    for tz in ("Asia/Tokyo", "UTC"):
        with sl.create(tmp_path / tz.replace("/", ""), tz=tz) as other:
            told[tz] = import_file(other, lines).plan.warnings
            assert [22, 23] == [int(entry.happened_ns // 3600e9 % 24) for entry in other.history()]
    (warning,) = told["UTC"]
    assert "of a log in Asia/Tokyo, this one is in UTC" in warning
    assert "init --tz Asia/Tokyo" in warning
    assert () == told["Asia/Tokyo"]


def test_a_zone_that_is_none_is_a_bad_line(tmp_path: Path) -> None:
    """As any other wrong value."""
    lines = tmp_path / "lines.jsonl"
    lines.write_text('{"timezone": "Mars/Olympus", "kind": "DoorAdded"}\n')
    with (
        sl.create(tmp_path / "log", tz="UTC") as log,
        pytest.raises(FormatError, match=r"lines\.jsonl:1: No time"),
    ):
        import_file(log, lines)


def test_the_file_again_changes_nothing(tmp_path: Path) -> None:
    """Not a byte: neither in the copy nor in the log that it was exported from."""
    path = random_log(tmp_path / "log", seed=3)
    copy = copied(path)
    taken_in(copy, lines_of(path))  # once more, as opening itself may close and continue a file
    before = lines_of(copy).read_bytes()

    for log in (path, copy):
        again = taken_in(log, lines_of(path))

        assert (0, None) == (again.plan.count, again.first_event)
    assert before == lines_of(copy).read_bytes() == lines_of(path).read_bytes()


def test_a_log_that_grew_brings_only_what_is_new(tmp_path: Path) -> None:
    """At the times at which it was recorded: the copy is the log again."""
    path = random_log(tmp_path / "log", seed=4, commits=20)
    copied(path)
    held = len(list(sl.read(path).history()))
    with sl.append(path, clock=SteadyClock(1_780_000_000 * 10**9)) as log:
        door = log.add_door(name="new", level=0, actor="eva")
        log.observe(door, "open")
        log.retract(log.state.event)

    grown = taken_in(tmp_path / "copy", lines_of(path))

    assert (4, held) == (grown.plan.count, grown.first_event)
    assert_same_answers(sl.read(path), sl.read(tmp_path / "copy"), count=4)


def test_an_import_that_was_interrupted_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind the last commit that was stored."""
    path = random_log(tmp_path / "log", seed=5)
    file = lines_of(path)
    whole, calls = sl.DoorLogWriter.take_over, []

    def interrupted(self: sl.DoorLogWriter, *args: Any, **more: Any) -> Any:
        calls.append(args)
        if len(calls) == 9:
            raise KeyboardInterrupt
        return whole(self, *args, **more)

    with monkeypatch.context() as patch:
        patch.setattr(sl.DoorLogWriter, "take_over", interrupted)
        with pytest.raises(KeyboardInterrupt):
            taken_in(tmp_path / "copy", file)
    assert 8 == len(list(sl.read(tmp_path / "copy").commits()))

    taken_in(tmp_path / "copy", file)

    assert_same_answers(sl.read(path), sl.read(tmp_path / "copy"), count=4)


def own_log(path: Path) -> Path:
    """Write a log with a door and events of its own."""
    with sl.create(path, tz="UTC", clock=SteadyClock()) as log:
        door = log.add_door(door_id=sl.DoorId(1000))
        for _ in range(7):
            log.observe(door, "open")
    return path


@pytest.mark.parametrize("seed", [6, 7])
def test_a_log_with_events_of_its_own_takes_the_others_behind_them(
    seed: int, tmp_path: Path
) -> None:
    """Its recorded times are now; commits, notes, and what is taken back are as they were."""
    path, own = random_log(tmp_path / "log", seed, commits=15), own_log(tmp_path / "own")
    imported = taken_in(own, lines_of(path))
    log, other = sl.read(path), sl.read(own)
    first = imported.first_event

    assert first == 8
    assert any("recorded: now" in text for text in imported.plan.summary)
    assert [(c.first_event + first, c.count, c.command_id, c.note) for c in log.commits()] == [
        (c.first_event, c.count, c.command_id, c.note) for c in list(other.commits())[8:]
    ]
    there = list(other.history())[8:]
    assert [e.retracted for e in log.history()] == [e.retracted for e in there]
    assert [e.happened_ns for e in log.history()] == [e.happened_ns for e in there]
    assert LATER_NS < min(e.recorded_ns for e in there)
    for mine, its in zip(log.history(kinds=[Retracted]), other.history(kinds=[Retracted]),
                         strict=True):  # fmt: skip
        assert isinstance(mine.event, Retracted)
        assert isinstance(its.event, Retracted)
        assert mine.event.first_event + first == its.event.first_event
        assert mine.event.last_event + first == its.event.last_event


def test_a_moment_is_exported_with_what_was_taken_back_of_it(tmp_path: Path) -> None:
    """What is known today about that time, though it was taken back later."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock()) as log:
        door = log.add_door(at="2026-02-01", state="closed")
        log.observe(door, "open", at="2026-02-02")
        log.retract(log.state.event, at="2026-02-09")
        log.observe(door, "moving", at="2026-02-05")
        at_ns = log.instant("2026-02-03")
        expected = log.replay(at=at_ns).doors
    file = lines_of(tmp_path / "log", Scope(at_ns=at_ns))

    taken_in(tmp_path / "copy", file)

    kinds = [json.loads(line)["kind"] for line in file.read_text().splitlines()]
    assert ["DoorAdded", "DoorObserved", "Retracted"] == kinds
    assert repr(expected) == repr(sl.read(tmp_path / "copy").replay().doors)


def test_a_door_that_a_retraction_brought_back_can_be_removed_again(tmp_path: Path) -> None:
    """The retraction begins before the removal, so only the next commit knows of it."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock()) as log:
        door = log.add_door()
        log.observe(door, "open")
        log.remove_door(door)
        log.retract(1, 2)
        log.remove_door(door)

    with sl.read(tmp_path / "log") as log, sl.read(copied(tmp_path / "log")) as copy:
        assert history(log) == history(copy)
        assert [] == list(copy.replay().doors)


def test_a_line_that_was_changed_is_refused(tmp_path: Path) -> None:
    """Its command is stored already: it would be passed over in silence."""
    path = own_log(tmp_path / "log")
    file = lines_of(path)
    copy = tmp_path / "copy"
    taken_in(copy, file)
    text = file.read_text()
    for old, new in (('"OPEN"', '"CLOSED"'), ('"happened"', '"actor": "eva", "happened"')):
        first, _, rest = text.partition("\n")
        file.write_text(first + "\n" + rest.replace(old, new, 1))

        with pytest.raises(FormatError, match=r"log.jsonl:2: command_id"):
            taken_in(copy, file)
    assert 8 == len(list(sl.read(copy).history()))


def test_a_command_that_is_sent_again_after_the_move_is_known(tmp_path: Path) -> None:
    """A robot that heard no answer asks the copy."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock()) as log:
        door = log.add_door(name="front", command_id=b"a" * 16)
        log.observe("front", "open", command_id=b"b" * 16)
    copied(tmp_path / "log")

    with sl.append(tmp_path / "copy") as log:
        assert door == log.add_door(name="front", command_id=b"a" * 16)
        assert log.observe("front", "open", command_id=b"b" * 16).repeated
        assert log.state.event == 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["office", "clinic_week"])
def test_a_recording_comes_back_as_it_was(name: str, tmp_path: Path) -> None:
    """At every moment that ships, and in what is believed."""
    log = sl.read(RECORDINGS / name)
    file = tmp_path / "lines.jsonl"
    export(log, file)
    taken_in(tmp_path / "copy", file, tz=log.info.timezone)
    copy = sl.read(tmp_path / "copy")

    assert commits(log) == commits(copy)
    moments = json.loads((RECORDINGS / f"{name}.expected.json").read_text())
    for moment in moments:
        scope = {key: moment[key] for key in ("at", "known_at", "event")}
        assert door_table(log, **scope) == door_table(copy, **scope)
    for at in (None, moments[-1]["at"], *(m["known_at"] for m in moments[:3])):
        assert repr(probabilities(log, at=at)) == repr(probabilities(copy, at=at))
    export(copy, tmp_path / "again.jsonl")
    assert file.read_bytes() == (tmp_path / "again.jsonl").read_bytes()


def test_what_a_log_took_is_not_judged_again(tmp_path: Path) -> None:
    """A door was removed as of now, and the same commit tells of it later: history, and no more."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock()) as log:
        door = log.add_door()
        seen = DoorObserved(door_id=door, state=DoorState.OPEN, happened_ns=LATER_NS)
        log.append([DoorRemoved(door_id=door), seen])

    copied(tmp_path / "log")

    assert_same_answers(sl.read(tmp_path / "log"), sl.read(tmp_path / "copy"), count=2)
