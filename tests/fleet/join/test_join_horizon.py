"""Joins of logs that no longer keep all of their history: as before, or an error; never a guess."""

from __future__ import annotations

import random
import shutil
import time
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.cli import main
from semmap_log.core.model.events import RobotPose
from semmap_log.errors import HorizonError, HorizonWarning
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.trimming.redaction import Redaction, Tracks
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.reading.reader import LogReader
from tests.log.trimming.logs import (
    SECOND_NS,
    START_NS,
    MinuteClock,
    answers_of,
    moments,
    random_log,
)

pytestmark = [
    pytest.mark.filterwarnings(f"ignore::semmap_log.errors.{name}")
    for name in ("HorizonWarning", "SensorWarning")
]

KEYS = ("at", "known_at")
FEW_NS = 4
"""What stands for the last event before the horizon may be told right at it."""
FRAMES = dict.fromkeys(("one", "two"), (0.0, 0.0, 0.0))


def trimmed(log: Path, folder: Path, until_ns: int) -> Path:
    copy = Path(shutil.copytree(log, folder / log.name))
    trim_log(copy, Retention(LogReader(copy), until_ns))
    assert LogReader(copy).horizon
    return copy


def places_and_states(answer: Any) -> Any:
    """Return an answer without numbers, which follow from who was added first."""
    return answer if isinstance(answer, str) else sorted(row[1:3] for row in answer)


@pytest.mark.parametrize("seed", range(8))
def test_it_answers_as_before_from_the_latest_horizon_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Of two logs one or both keep less; at what had happened, at what was known, and both."""
    draw = random.Random(seed)
    logs = {
        name: random_log(tmp_path / name, 10 * seed + i, monkeypatch, commits=150, roll=30)
        for i, name in enumerate(("one", "two"))
    }
    asked = [m for m in moments(logs["one"], seed, count=40) if "event" not in m]
    before = [places_and_states(a) for a in answers_of(sl.join(logs, frames=FRAMES), asked)]
    keeping = ["one", "two"] if seed % 2 else ["one"]
    for name in keeping:
        until_ns = [c.recorded_ns for c in LogReader(logs[name]).commits()][draw.randrange(70, 140)]
        logs[name] = trimmed(logs[name], tmp_path / f"kept {name}", until_ns)

    joined = sl.join(logs, frames=FRAMES)
    after = [places_and_states(a) for a in answers_of(joined, asked)]

    horizon_ns = max(LogReader(log).horizon_ns for log in logs.values())
    assert abs(joined.horizon_ns() - horizon_ns) < FEW_NS
    for moment, was, now in zip(asked, before, after, strict=True):
        is_kept = all(int(moment[k][1:]) >= joined.horizon_ns() for k in KEYS if k in moment)
        assert now == (was if is_kept else "HorizonError"), moment
    assert any(now == "HorizonError" for now in after)
    assert any(now == was for was, now in zip(before, after, strict=True))
    assert joined.replay().doors.keys() == sl.join(logs, frames=FRAMES).replay().doors.keys()


@pytest.mark.parametrize("is_kept", [True, False], ids=["kept since", "kept"])
@pytest.mark.parametrize("seed", range(3))
def test_alone_it_believes_what_the_log_itself_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int, *, is_kept: bool
) -> None:
    """Its sightings were thinned: what went counts."""
    log = random_log(tmp_path / "one", seed, monkeypatch, commits=300, roll=30)
    times = [c.recorded_ns for c in LogReader(log).commits()]
    until_ns, last_ns = times[250], times[-1]
    trim_log(log, Thinning(LogReader(log), until_ns))
    if is_kept:
        trim_log(log, Retention(LogReader(log), until_ns - 100 * 60 * SECOND_NS))
        assert LogReader(log).horizon
    with a_log(tmp_path / "two", MinuteClock()) as other:
        for i in range(30):
            other.add_door(x=50.0, y=float(i), theta=0.0, width=0.9, name=f"other {i}")

    joined = sl.join({"one": log, "two": tmp_path / "two"}, frames=FRAMES)

    at = f"@{last_ns + SECOND_NS}"
    mine = {f"one/{b.door.name}": b.p_open for b in probabilities(sl.read(log), at=at)}
    theirs = {b.door.name: b.p_open for b in probabilities(joined, at=at)}
    assert len(mine) == 3
    for name, p_open in mine.items():
        assert theirs[name] == pytest.approx(p_open, abs=0.001), name


def test_a_pin_of_one_log_is_none_of_the_join(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The state that it keeps is that of its own doors; later ones are names of moments as ever."""
    log = quiet_and_busy(tmp_path, monkeypatch)
    commits = [c.recorded_ns for c in LogReader(log).commits()]
    with sl.append(log, clock=MinuteClock(), compact=False) as opened:
        opened.pin("early", at=f"@{commits[3]}")
        opened.pin("late", at=f"@{commits[-1]}")
    trim_log(log, Retention(LogReader(log), commits[-1]))
    assert sl.read(log).replay(at="pin:early").doors
    with a_log(tmp_path / "two", MinuteClock()) as other:
        other.add_door(x=9.0, y=1.0, theta=0.0, width=0.9, name="other", state="closed")

    joined = sl.join({"one": log, "two": tmp_path / "two"})

    assert answers_of(joined, [{"at": f"@{commits[3]}"}]) == ["HorizonError"]
    with pytest.raises(sl.SemmapError, match="early"):
        joined.replay(at="pin:early")
    assert len(joined.replay(at="pin:late").doors) == 3


def a_log(path: Path, clock: MinuteClock) -> sl.DoorLogWriter:
    return sl.create(path, tz="UTC", clock=clock, compact=False)


def quiet_and_busy(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a log with a door that is seen once, and one that is seen for long."""
    monkeypatch.setattr("semmap_log.store.writing.segment_chain.ROLL_COMMITS", 10)
    with a_log(folder / "one", MinuteClock()) as log:
        quiet = log.add_door(x=1.0, y=1.0, theta=0.0, width=0.9, name="quiet", state="closed")
        busy = log.add_door(x=2.0, y=1.0, theta=0.0, width=0.9, name="busy")
        log.observe(quiet, "open")
        for i in range(40):
            log.observe(busy, "open" if i % 2 else "closed")
    return folder / "one"


def test_a_door_that_was_last_seen_before_the_horizon_is_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its sighting is gone; the keyframe at the horizon knows of it."""
    log = trimmed(quiet_and_busy(tmp_path, monkeypatch), tmp_path / "kept", 2**62)
    with a_log(tmp_path / "two", MinuteClock()) as other:
        other.add_door(x=9.0, y=1.0, theta=0.0, width=0.9, name="other", state="closed")

    joined = sl.join({"one": log, "two": tmp_path / "two"})

    states = {door.name: door.state.name for door in joined.replay().doors.values()}
    assert states == {"one/quiet": "OPEN", "one/busy": "OPEN", "two/other": "CLOSED"}
    with pytest.warns(HorizonWarning, match="history begins at event"):
        list(joined.history("one/quiet"))
    with pytest.raises(HorizonError, match="ask about a later moment"):
        joined.replay(event=1)


def test_what_is_taken_back_later_makes_history_begin_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other log takes back what it told before the horizon: before that, both were believed."""
    log = trimmed(quiet_and_busy(tmp_path, monkeypatch), tmp_path / "kept", 2**62)
    clock = MinuteClock()
    with a_log(tmp_path / "two", clock) as other:
        door = other.add_door(x=9.0, y=1.0, theta=0.0, width=0.9, name="other", state="closed")
        wrong = other.observe(door, "open").commit.last_event
        clock.now_ns += 3600 * SECOND_NS
        other.observe(door, "closed", at="@1700000000")  # late: it does not count
        back_ns = other.retract(wrong).commit.recorded_ns

    joined = sl.join({"one": log, "two": tmp_path / "two"})

    horizon_ns = LogReader(log).horizon_ns
    assert horizon_ns < back_ns
    assert joined.horizon() > 0
    told = answers_of(joined, [{"at": f"@{horizon_ns + 1}"}, {"at": f"@{back_ns + 2 * SECOND_NS}"}])
    assert told[0] == "HorizonError"
    assert sorted(row[1].name for row in told[1]) == ["CLOSED", "OPEN", "OPEN"]


def test_a_retraction_that_ends_all_logs_makes_history_begin_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is behind it: only now can be asked about."""
    log = trimmed(quiet_and_busy(tmp_path, monkeypatch), tmp_path / "kept", 2**62)
    clock = MinuteClock()
    with a_log(tmp_path / "two", clock) as other:
        door = other.add_door(x=9.0, y=1.0, theta=0.0, width=0.9, name="other", state="closed")
        wrong = other.observe(door, "open").commit.last_event
        clock.now_ns = 2 * time.time_ns()
        other.retract(wrong)

    joined = sl.join({"one": log, "two": tmp_path / "two"})

    asked = [{"at": f"@{LogReader(log).horizon_ns + 1}"}, {"event": 1}]
    assert answers_of(joined, asked) == ["HorizonError"] * 2
    states = {door.name: door.state.name for door in joined.replay().doors.values()}
    assert states == {"one/quiet": "OPEN", "one/busy": "OPEN", "two/other": "CLOSED"}


@pytest.mark.parametrize("with_other", [True, False])
def test_it_begins_there_though_nothing_else_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, with_other: bool
) -> None:
    """The log's only sighting was taken back: no door's state rests on it, and then it was OPEN."""
    monkeypatch.setattr("semmap_log.store.writing.segment_chain.ROLL_COMMITS", 4)
    with a_log(tmp_path / "one", MinuteClock()) as log:
        door = log.add_door(x=1.0, y=1.0, theta=0.0, width=0.9, name="front", state="closed")
        seen = log.observe(door, "open").commit
        log.retract(seen.first_event)
        for i in range(12):
            log.annotate(door, "looked at", str(i))
    with a_log(tmp_path / "two", MinuteClock()) as other:
        other.add_door(x=9.0, y=1.0, theta=0.0, width=0.9, name="other", state="closed")
    kept = trimmed(tmp_path / "one", tmp_path / "kept", 2**62)

    joined = sl.join({"one": kept} | ({"two": tmp_path / "two"} if with_other else {}))

    asked = [{"known_at": f"@{seen.closed_ns}"}, {"at": f"@{seen.closed_ns}"}]
    assert answers_of(joined, asked) == ["HorizonError"] * 2
    assert {door.state.name for door in joined.replay().doors.values()} == {"CLOSED"}


def test_a_retraction_of_what_is_gone_moves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pose behind the horizon, redacted with its commit: it is in no state."""
    log, clock = quiet_and_busy(tmp_path, monkeypatch), MinuteClock()
    until_ns = [c.recorded_ns for c in LogReader(log).commits()][25]
    clock.now_ns += 3600 * SECOND_NS
    with sl.append(log, clock=clock, compact=False) as opened:
        poses = [opened.append([RobotPose(x=1.0, y=2.0, theta=0.0)]) for _ in range(20)]
        opened.observe(1, "closed")
    trim_log(log, Retention(LogReader(log), until_ns))
    trim_log(log, Redaction.of(LogReader(log), [Tracks()], LogReader(log).last_event() + 1))
    with sl.append(log, compact=False) as opened:
        opened.retract(poses[3].commit.last_event)

    joined = sl.join({"one": log})

    assert 0 <= joined.horizon_ns() - LogReader(log).horizon_ns < FEW_NS


@pytest.mark.parametrize("is_one_log", [True, False])
def test_of_equal_times_the_later_told_counts_though_the_earlier_is_before_the_horizon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, is_one_log: bool
) -> None:
    """It comes in its place, before what another log recorded."""
    monkeypatch.setattr("semmap_log.store.writing.segment_chain.ROLL_COMMITS", 6)
    clock, later, then = MinuteClock(), MinuteClock(), f"@{START_NS + 100 * SECOND_NS}"
    place = {"x": 1.0, "y": 1.0, "theta": 0.0, "width": 0.9}
    doors = []
    with a_log(tmp_path / "one", clock) as log:
        old = log.add_door(**place, name="front")
        log.append([RobotPose(x=1.0, y=1.0, theta=0.0)])
        clock.now_ns += 200 * SECOND_NS
        log.observe(old, "open", at=then)
        if is_one_log:
            log.remove_door(old, at=then)
            new = log.add_door(**place, name="new", state="closed", at=then)
            doors = [("one", str(door), "front") for door in (old, new)]
        for i in range(30):
            log.annotate(new if is_one_log else old, "looked at", str(i))
    with a_log(tmp_path / "two", later) as other:
        seen = other.add_door(**place, name="other" if is_one_log else "front")
        if not is_one_log:
            later.now_ns += 202 * SECOND_NS
            other.observe(seen, "closed", at=then)

    def state(one: Path) -> str:
        joined = sl.join({"one": one, "two": tmp_path / "two"}, frames=FRAMES, doors=doors)
        return next(d.state.name for d in joined.replay().doors.values() if d.name == "front")

    before = state(tmp_path / "one")
    kept = trimmed(tmp_path / "one", tmp_path / "kept", 2**62)
    assert before == state(kept) == "CLOSED"


def test_a_log_that_is_made_of_it_knows_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It verifies, says what it no longer keeps, and is the same again byte for byte."""
    log = trimmed(quiet_and_busy(tmp_path, monkeypatch), tmp_path / "kept", 2**62)
    for new in ("new", "again"):
        with pytest.raises(SystemExit, match="0"):
            main(["join", f"{tmp_path}/{new}.join.json", str(log), "--write", f"{tmp_path}/{new}"])

    found = verify(tmp_path / "new")

    assert not [one for one in found.findings if one.severity]
    doors = sl.read(tmp_path / "new").replay().doors.values()
    assert {door.name: door.state.name for door in doors} == {"quiet": "OPEN", "busy": "OPEN"}
    assert answers_of(sl.read(tmp_path / "new"), [{"event": 1}]) == ["HorizonError"]
    first, second = (
        [path.read_bytes() for path in sorted((tmp_path / new).glob("*.mcap"))]
        for new in ("new", "again")
    )
    assert first == second
