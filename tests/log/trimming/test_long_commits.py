"""Commits of several chunks, with keyframes between them, are trimmed like all others."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAnnotated, DoorObserved, Event, RobotPose
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay import written_state
from semmap_log.log.replay.maintenance import recover, verify
from semmap_log.log.trimming.redaction import Notes, Redaction, Tracks
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store import commit_records
from semmap_log.store.compaction import merge
from semmap_log.store.pages import KEYFRAME_BIT
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.trimming.remaining_records import RemainingRecords
from tests.log.trimming.logs import SECOND_NS, START_NS, MinuteClock, answers
from tests.store.trimming.plain_chain import read_plainly

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")

RULES = {
    "tracks": lambda log: Redaction([Tracks()], LogReader(log).last_event() + 1),
    "notes": lambda log: Redaction([Notes()], LogReader(log).last_event() + 1),
    "thin": lambda log: Thinning(LogReader(log), LogReader(log).last_log_time_ns()),
    "keep": lambda log: Retention(LogReader(log), LogReader(log).last_log_time_ns() + 1),
}
DOORS = 4
LONG_BEFORE = f"@{START_NS // SECOND_NS - 10**6}"


@pytest.fixture(autouse=True)
def _keyframes_are_close(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commit_records, "CHUNK_BYTES", 600)
    monkeypatch.setattr(merge, "CHUNK_BYTES", 900)
    monkeypatch.setattr(merge, "KEYFRAME_EVERY_BYTES", 900)
    monkeypatch.setattr(written_state, "KEYFRAME_EVERY_BYTES", 900)
    monkeypatch.setattr(written_state, "KEYFRAME_RARITY", 0)


def imported(path: Path, *, commits: int = 1) -> Path:
    """Return a log whose history came in long commits: poses, sightings that repeat, a note."""
    clock = MinuteClock()
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        for door in range(DOORS):
            where = {"x": float(door), "y": 0.0, "theta": 0.0, "width": 0.9}
            log.add_door(**where, name=f"d{door}", at=LONG_BEFORE)
        for part in range(commits):
            start_ns = START_NS - 10**5 * SECOND_NS * (commits - part)
            events = [_event(i, start_ns + i * 60 * SECOND_NS) for i in range(120)]
            log.append(events, note=sl.Note(actor="importer"))
    return path


def _event(i: int, happened_ns: int) -> Event:
    if i % 3 == 1:
        return RobotPose(x=float(i), y=0.0, theta=0.0, happened_ns=happened_ns)
    if i % 40 == 39:
        return DoorAnnotated(door_id=1, key="k", value=str(i), happened_ns=happened_ns)
    state = DoorState.OPEN if i // 50 % 2 else DoorState.CLOSED
    return DoorObserved(
        door_id=1 + i % DOORS, state=state, accuracy_open=0.9, accuracy_closed=0.9,
        happened_ns=happened_ns,
    )  # fmt: skip


def keyframes_within_commits(log: Path) -> list[int]:
    """Return the numbers of the events right after keyframes in the midst of a commit."""
    reader = LogReader(log)
    ends = {0, *(commit.last_event + 1 for commit in reader.commits())}
    next_events = [
        int(number)
        for segment in reader.segments
        for number in segment.next_events[segment.chunks.rows["kinds"] == KEYFRAME_BIT]
    ]
    return [number for number in next_events if number not in ends]


def asked(log: Path) -> list[dict[str, Any]]:
    last = sl.read(log).last_event()
    ends = [{"known_at": f"@{c.recorded_ns}"} for c in sl.read(log).commits()]
    return [{}, *ends, {"at": f"@{START_NS + 1000 * SECOND_NS}"}, {"event": last}]


def check_sound(log: Path) -> None:
    found, plain = verify(log), read_plainly(log)
    assert [f.text for f in found.findings if f.severity and f.kind != "leftover"] == []
    assert plain.head == found.head
    assert len(plain.events) == found.events


@pytest.mark.parametrize("commits", [1, 3])
@pytest.mark.parametrize("kind", RULES)
def test_what_is_left_answers_as_before(tmp_path: Path, kind: str, commits: int) -> None:
    """A keyframe within a commit is neither a horizon nor in the way of what goes around it."""
    log = imported(tmp_path / "log", commits=commits)
    assert len(keyframes_within_commits(log)) > 3
    questions = asked(log)
    before = answers(log, questions)

    trim_log(log, RULES[kind](log))

    check_sound(log)
    for now, was in zip(answers(log, questions), before, strict=True):
        assert now == was or (kind == "keep" and now == "HorizonError")
    horizon = LogReader(log).horizon
    assert horizon in {0, *(commit.last_event + 1 for commit in LogReader(log).commits())}
    trim_log(log, RULES["keep"](log))
    check_sound(log)
    assert answers(log, [{}]) == before[:1]


def test_a_copy_that_fails_its_check_takes_the_place_of_nothing(tmp_path: Path) -> None:
    """The events stay; the log says that nothing was taken out, and goes on."""
    log = imported(tmp_path / "log", commits=3)
    before = [repr(recorded) for batch in LogReader(log).batches() for recorded in batch]
    questions = asked(log)
    wanted = answers(log, questions)
    rule = Retention(LogReader(log), START_NS * 2)
    rule.horizon = keyframes_within_commits(log)[-1]  # which earlier versions took for one
    with pytest.raises(CorruptLogError, match=r"failed its check .* left as it was"):
        trim_log(log, rule)

    assert answers(log, questions) == wanted
    check_sound(log)
    left = [repr(recorded) for batch in LogReader(log).batches() for recorded in batch]
    assert left[: len(before)] == before
    trim_log(log, RULES["tracks"](log))
    check_sound(log)


@pytest.mark.parametrize("which", [1, 6, 8, 15, -1])
def test_a_log_that_an_earlier_version_broke_is_recovered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, which: int
) -> None:
    """That took a keyframe within a commit for the horizon: all that is left answers again."""
    log = imported(tmp_path / "log", commits=3)
    questions = asked(log)
    before = answers(log, questions)
    horizon = keyframes_within_commits(log)[which]
    later = [repr(one) for batch in LogReader(log).batches() for one in batch
             if one.number >= horizon]  # fmt: skip
    break_as_version_0_1_did(log, horizon, monkeypatch)
    assert verify(log).exit_code == 4
    assert answers(log, [{}]) == ["CorruptLogError"]

    recovered = recover(log)

    assert (recovered.plan.lost_events, recovered.plan.losses) == (0, ())
    check_sound(log)
    assert LogReader(log).horizon == horizon
    for now, was in zip(answers(log, questions), before, strict=True):
        assert now in (was, "HorizonError")
    assert answers(log, [{}]) == before[:1]
    left = [one for batch in sl.read(log).batches() for one in batch if one.number >= horizon]
    assert [repr(replace(one, recorded_ns=0)) for one in left][: len(later)] == [
        re.sub(r"recorded_ns=\d+", "recorded_ns=0", one) for one in later
    ]
    with sl.append(log) as opened:
        opened.observe(1, "open")
    assert sl.read(log).replay().doors[1].state is DoorState.OPEN
    for kind in ("notes", "thin", "keep"):
        trim_log(log, RULES[kind](log))
        check_sound(log)


def break_as_version_0_1_did(log: Path, horizon: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Move the horizon to a keyframe within a commit."""
    rule = Retention(LogReader(log), START_NS * 2)
    rule.horizon = horizon
    with monkeypatch.context() as patch:
        patch.setattr("semmap_log.log.trimming.trim_log.check_copy", lambda _log, _copy: None)
        patch.setattr(RemainingRecords, "_next_number", _number_before_the_horizon)
        with pytest.raises(CorruptLogError):
            trim_log(log, rule)


def _number_before_the_horizon(left: Any) -> int:
    return left._horizon if left._has_keyframe else left._next_event
