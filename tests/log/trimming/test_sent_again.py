"""Commands that are sent again once their events were taken out: stored once, and known."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAnnotated, DoorObserved, DoorUpdated, Event, RobotPose
from semmap_log.core.model.meaning import Changed
from semmap_log.errors import CommandReusedError
from semmap_log.log.replay.maintenance import copy, verify
from semmap_log.log.trimming.redaction import Notes, Redaction, Tracks
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, TrimRule, trim_log
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.tombstones import tombstones
from semmap_log.store.trimming import remaining_records
from semmap_log.store.writing import segment_chain
from tests.log.trimming.logs import MinuteClock
from tests.store.trimming.plain_chain import read_plainly

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")

RULES: dict[str, Callable[[LogReader], TrimRule]] = {
    "thin": lambda reader: Thinning(reader, reader.last_log_time_ns()),
    "keep": lambda reader: Retention(reader, reader.last_log_time_ns() + 1),
    "tracks": lambda reader: Redaction([Tracks()], reader.last_event() + 1),
    "notes": lambda reader: Redaction([Notes()], reader.last_event() + 1),
}


def an_id(number: int) -> bytes:
    return hashlib.sha256(b"robot %d" % number).digest()[:16]


def seen(state: DoorState = DoorState.OPEN, **more: Any) -> DoorObserved:
    return DoorObserved(door_id=1, state=state, accuracy_open=0.9, accuracy_closed=0.9, **more)


def commands() -> Iterator[tuple[list[Event], dict[str, Any]]]:
    """Yield what is asked for, and how: alone, together, with notes, times, digests, poses."""
    pose = RobotPose(x=1.0, y=2.0, theta=0.5)
    for i in range(3):
        yield [seen()], {}
        yield [seen(), pose, seen()], {"note": sl.Note(actor="anna", reason=f"round {i}")}
        yield [pose], {}
        yield [pose, seen(), seen()], {"note": sl.Note(actor="anna")}
        yield [seen()], {"content": bytes([i]) * 16}
        yield [DoorAnnotated(door_id=1, key="k", value=str(i)), seen()], {}
        yield [DoorUpdated(door_id=1, changed=Changed.STATE, state=DoorState.OPEN), seen()], {}


Answers = list[tuple[int, int]]


@pytest.fixture
def sent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Answers]:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 15)
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", clock=MinuteClock(), compact=False) as opened:
        opened.add_door(x=0.0, y=0.0, theta=0.0, width=0.9, name="front")
        opened.append([seen()], command_id=an_id(99))
    first = send(path)
    with sl.append(path, clock=MinuteClock(), compact=False) as opened:
        for _ in range(20):
            opened.observe(1, "closed")
    return path, first


@pytest.fixture
def log(sent: tuple[Path, Answers]) -> Path:
    return sent[0]


@pytest.fixture
def first(sent: tuple[Path, Answers]) -> Answers:
    """What was answered when the commands were sent first."""
    return sent[1]


def send(path: Path) -> Answers:
    """Send all commands; return first event and count as they are answered."""
    with sl.append(path, clock=MinuteClock(), compact=False) as opened:
        appended = [
            opened.append(events, command_id=an_id(i), **how)
            for i, (events, how) in enumerate(commands())
        ]
        return [(one.first_event, one.count) for one in appended]


def check_known(path: Path, first: Answers) -> None:
    """Send all again: nothing is stored, the answers are the first ones; others are refused."""
    last = sl.read(path).last_event()
    assert send(path) == first
    assert sl.read(path).last_event() == last
    with sl.append(path, compact=False) as opened:
        for i, (events, how) in enumerate(commands()):
            for given, other in others_than(events, how):
                with pytest.raises(CommandReusedError):
                    opened.append(given, command_id=an_id(i), **other)
    assert sl.read(path).last_event() == last


def others_than(
    events: list[Event], how: dict[str, Any]
) -> Iterator[tuple[list[Event], dict[str, Any]]]:
    """Yield other commands than that one."""
    yield events, how | {"content": bytes([77]) * 16}
    if "content" not in how:
        yield [*events[:-1], RobotPose(x=9.0, y=2.0, theta=0.5)], how
        yield [*events, seen(DoorState.CLOSED)], how
        yield events, how | {"note": sl.Note(actor="bert")}


def check_sound(path: Path) -> None:
    found = verify(path)
    assert [f.text for f in found.findings if f.severity and f.kind != "leftover"] == []
    assert read_plainly(path).head == found.head


@pytest.mark.parametrize("kinds", [*RULES, "thin keep", "notes thin tracks keep", "keep keep"])
def test_a_command_is_stored_once_however_much_of_it_is_gone(
    log: Path, first: Answers, kinds: str
) -> None:
    """It is answered with the numbers of the first time, also in copies and compacted logs."""
    check_known(log, first)

    for kind in kinds.split():
        with sl.append(log, compact=False) as opened:
            opened.observe(1, "closed")
        trim_log(log, RULES[kind](LogReader(log)))
        check_sound(log)
        check_known(log, first)

    compact(log)
    check_known(log, first)
    target = log.with_name("copy")
    copy(log, target)
    check_known(target, first)
    check_sound(target)


def test_what_is_gone_cannot_be_found_without_the_id(log: Path) -> None:
    """No id of a commit that is gone as a whole stays in the log, and no digest of its content."""
    send(log)
    ids = [an_id(i) for i, (events, _) in enumerate(commands()) if events == [seen()]]
    trim_log(log, RULES["keep"](LogReader(log)))
    horizon = LogReader(log).horizon
    kept = {commit.command_id for commit in LogReader(log).commits()}
    data = b"".join(bytes(page.records) for _, page in LogReader(log).pages())

    assert horizon > 40
    assert not [one for one in ids if one in kept or one in data]


def test_ids_that_a_writer_drew_take_no_place(tmp_path: Path) -> None:
    """Nobody can send them again."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", clock=MinuteClock(), compact=False) as opened:
        opened.add_door(x=0.0, y=0.0, theta=0.0, width=0.9, name="front")
        for _ in range(60):
            opened.observe(1, "open")

    trim_log(path, RULES["thin"](LogReader(path)))

    found = [len(t.parts) for s in LogReader(path).segments for t, _ in tombstones(s)]
    assert sum(found) == 0 < len(found)


def test_many_commands_take_several_tombstones(
    log: Path, first: Answers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """None becomes larger than a chunk should be."""
    monkeypatch.setattr(remaining_records, "MOST_COMMANDS", 3)

    trim_log(log, RULES["thin"](LogReader(log)))
    check_known(log, first)
    monkeypatch.setattr(remaining_records, "MOST_COMMANDS", 5)
    with sl.append(log, compact=False) as opened:
        opened.observe(1, "closed")
    trim_log(log, RULES["keep"](LogReader(log)))

    check_sound(log)
    check_known(log, first)


def test_commands_of_a_log_that_an_earlier_version_trimmed(
    log: Path, first: Answers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of commits that lack records it kept no seal: their ids stand, whatever they asked for."""
    with monkeypatch.context() as patch:
        patch.setattr(remaining_records._OpenCommit, "seal", lambda _commit, _said: bytes(32))
        trim_log(log, RULES["tracks"](LogReader(log)))
    whole = [i for i, (events, _) in enumerate(commands()) if len(events) > 1]

    answered = [(i, one) for i, one in enumerate(send(log)) if i in whole]

    assert [one[0] for _, one in answered] == [first[i][0] for i, _ in answered]


def test_lines_are_imported_once_after_a_trimming(log: Path, tmp_path: Path) -> None:
    """An export of before, imported again: the log holds all of it."""
    send(log)
    lines = tmp_path / "events.jsonl"
    with pytest.raises(SystemExit, match="0"):
        main(["export", str(log), str(lines)])
    trimmed = Path(shutil.copytree(log, tmp_path / "trimmed"))
    trim_log(trimmed, RULES["thin"](LogReader(trimmed)))
    last = sl.read(trimmed).last_event()

    with pytest.raises(SystemExit, match="0"):
        main(["import", str(trimmed), str(lines)])

    assert sl.read(trimmed).last_event() == last
