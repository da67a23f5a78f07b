"""What is told of a trimmed log's past later: answered as by the whole log, or refused."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import (
    DoorObserved,
    DoorPassed,
    HistoryTrimmed,
    Retracted,
    RobotPose,
)
from semmap_log.errors import CommandError, HorizonError
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.log.trimming.logs import SECOND_NS, START_NS, MinuteClock, answers

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")


@pytest.fixture
def short_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 4)


HOUR_NS = 3600 * SECOND_NS
BEGIN_NS = START_NS // HOUR_NS * HOUR_NS + HOUR_NS


def minute(number: float) -> int:
    return BEGIN_NS + int(number * 60) * SECOND_NS


def watched(path: Path, minutes: Sequence[tuple[float, str]]) -> Path:
    """Return a log of a door that was seen at these minutes, each recorded as it happened."""
    clock = MinuteClock()
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=0.9, name="front", state="closed")
        for at, state in minutes:
            clock.now_ns = minute(at)
            log.observe(1, state, actor="tug1", at=f"@{minute(at)}")
        clock.now_ns = minute(300)
        log.start_patrol()
    return path


def thinned(log: Path) -> Path:
    copy = Path(shutil.copytree(log, log.with_name("thinned")))
    assert trim_log(copy, Thinning(LogReader(copy), minute(300))).done.events
    return copy


HOUR = [(5, "open"), (10, "open"), (15, "open"), (20, "open"), (40, "closed"), (50, "closed"),
        (55, "closed"), (70, "closed")]  # fmt: skip
"""Of 10, 15 and 50 the sightings go: those of 5, 20, 40, 55 and 70 bound them."""


def is_between(at: float) -> bool:
    """Tell whether a moment is followed by a sighting that is gone, before one that stays."""
    return 5 <= at < 15 or 40 <= at < 50


@pytest.mark.parametrize("at", [1, 4.9, 5, 7, 10, 12, 14.9, 15, 17, 20, 30, 40, 45, 50, 52, 60, 80])
@pytest.mark.parametrize("state", ["open", "closed", "unknown"])
def test_a_late_report_counts_as_in_the_whole_log_or_is_refused(
    tmp_path: Path, at: float, state: str
) -> None:
    """It is refused only where it would have ended with a sighting that is gone."""
    whole = watched(tmp_path / "whole", HOUR)
    trimmed = thinned(whole)
    run = "open" if at < 30 else "closed"
    asked = [{"at": f"@{minute(m)}"} for m in (*range(0, 90, 2), at)]
    with sl.append(whole, compact=False) as log:
        log.observe(1, state, at=f"@{minute(at)}")

    with sl.append(trimmed, compact=False) as log:
        if is_between(at) and state != run:
            with pytest.raises(CommandError, match=r"thinned .* would not be known"):
                log.observe(1, state, at=f"@{minute(at)}")
        else:
            log.observe(1, state, at=f"@{minute(at)}")
            assert answers(trimmed, asked) == answers(whole, asked)


def late(state: DoorState = DoorState.CLOSED) -> DoorObserved:
    return DoorObserved(door_id=1, state=state, happened_ns=minute(7))


@pytest.mark.parametrize(
    "events",
    [
        [late()],
        [late(), late()],
        [DoorObserved(door_id=1, state=DoorState.OPEN), late()],
        [EventBatch.from_events([late(DoorState.OPEN), late()])],
        (each for each in [late()]),
    ],
)
def test_a_late_report_is_refused_by_every_way_in(tmp_path: Path, events: Any) -> None:
    """Nothing of its commit is stored."""
    trimmed = thinned(watched(tmp_path / "log", HOUR))
    last = sl.read(trimmed).last_event()
    with sl.append(trimmed, compact=False) as log:
        with pytest.raises(CommandError, match="thinned"):
            log.append(events)
        log.append([DoorPassed(door_id=1, passed=True, happened_ns=minute(7))])  # it was open
    assert sl.read(trimmed).last_event() == last + 1


@pytest.mark.usefixtures("short_segments")
def test_a_late_report_after_the_horizon_is_refused(tmp_path: Path) -> None:
    """In the hour of the horizon, too, from which nothing before it can be read."""
    log = watched(tmp_path / "log", [(at, "open") for at in range(2, 60, 2)])
    trim_log(log, Retention(LogReader(log), minute(20)))
    assert minute(0) < LogReader(log).horizon_ns < minute(30)
    kept = thinned(log)

    with (
        sl.append(kept, compact=False) as opened,
        pytest.raises(CommandError, match=r"thinned .* would not be known"),
    ):
        opened.observe(1, "closed", at=f"@{minute(41)}")


def test_lines_of_late_reports_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By `import`, with the line."""
    trimmed = thinned(watched(tmp_path / "log", HOUR))
    lines = tmp_path / "late.jsonl"
    told = {"kind": "DoorObserved", "door": "front", "state": "CLOSED"}
    lines.write_text(json.dumps(told | {"happened": f"@{minute(7)}"}) + "\n")

    with pytest.raises(SystemExit, match="1"):
        main(["import", str(trimmed), str(lines)])

    assert "line 1" in (said := capsys.readouterr().err) or ":1:" in said
    assert "thinned" in said


@pytest.mark.usefixtures("short_segments")
@pytest.mark.parametrize("rule", ["thin", "keep"])
def test_a_retraction_is_refused_by_every_way_in(tmp_path: Path, rule: str) -> None:
    """By the verb, in a list, in a batch, in a command line of `record`."""
    log = watched(tmp_path / "log", HOUR)
    if rule == "keep":
        trim_log(log, Retention(LogReader(log), minute(300)))
    else:
        log = thinned(log)
    last = sl.read(log).last_event()
    refused = Retracted(first_event=2, last_event=2)
    with sl.append(log, compact=False) as opened:
        if rule == "keep":  # the horizon is where the log was opened again
            opened.observe(1, "open")
        for events in ([refused], [EventBatch.from_events([refused])], iter([refused])):
            with pytest.raises(CommandError, match="no longer kept"):
                opened.append(events)
        with pytest.raises(CommandError, match="no longer kept"):
            opened.retract(2)
        seen = opened.observe(1, "moving")
        number = seen.commit.last_event
        opened.append([Retracted(first_event=number, last_event=number)])
        with pytest.raises(CommandError, match="taken back already"):
            opened.append([Retracted(first_event=number, last_event=number)])
        with pytest.raises(CommandError, match=f"the log holds 0..{number + 1}"):
            opened.append([Retracted(first_event=number + 2, last_event=number + 2)])
    assert sl.read(log).last_event() > last


def test_a_range_does_not_hide_what_tells_of_the_log(tmp_path: Path) -> None:
    """A pinned moment is let go of by its own number alone; a trimming never by a range."""
    path = watched(tmp_path / "log", HOUR)
    with sl.append(path, compact=False) as log:
        first = log.observe(1, "open").commit.last_event
        pinned = log.pin("audit").commit.last_event
        last = log.observe(1, "closed").commit.last_event
        log.retract(first, last)
        assert list(log.pins()) == ["audit"]
        log.retract(pinned)
        assert list(log.pins()) == []
    thinned(path)
    with sl.append(path.with_name("thinned"), compact=False) as log:
        numbers = [int(n) for batch in log.batches(kinds=[HistoryTrimmed]) for n in batch.number]
        log.retract(numbers[0] - 1, numbers[-1])
        told = [one.event for one in log.history() if isinstance(one.event, HistoryTrimmed)]
        assert len(told) == len(numbers) == 2


@pytest.mark.usefixtures("short_segments")
@pytest.mark.parametrize("seed", range(4))
def test_what_was_known_between_the_horizon_and_the_next_commit(tmp_path: Path, seed: int) -> None:
    """Is answered as before, whichever bound asks."""
    draw, log = random.Random(seed), tmp_path / "log"
    minutes = [(5 * i, draw.choice(["open", "closed"])) for i in range(40)]
    watched(log, minutes)
    with sl.append(log, compact=False) as opened:
        opened.observe(1, "open", at=f"@{minute(290)}")
    horizon_ns = _keep(log, draw)
    asked = [
        {name: f"@{horizon_ns + step}"}
        for name in ("at", "known_at")
        for step in (0, 1, SECOND_NS, 60 * SECOND_NS, 10**12)
    ]
    asked += [one | {"at": f"@{horizon_ns + 10**12}"} for one in asked if "known_at" in one]

    assert answers(log, asked) == answers(log.with_name("whole"), asked)
    for name in ("at", "known_at"):
        with pytest.raises(HorizonError, match="ask about a later moment"):
            sl.read(log).replay(**{name: f"@{horizon_ns - 1}"})


def _keep(log: Path, draw: random.Random) -> int:
    shutil.copytree(log, log.with_name("whole"))
    trim_log(log, Retention(LogReader(log), minute(draw.randrange(301, 400))))
    assert LogReader(log).horizon
    return LogReader(log).horizon_ns


@pytest.mark.usefixtures("short_segments")
def test_no_answer_knows_of_sightings_that_came_later_and_are_gone(tmp_path: Path) -> None:
    """Nor does a keyframe serve that does, of a segment from which nothing goes."""
    clock = MinuteClock()
    with sl.create(tmp_path / "log", tz="UTC", clock=clock, compact=False) as log:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=0.9)
        for at in (5, 10):
            clock.now_ns = minute(at)
            log.observe(1, "open", at=f"@{minute(at)}")
        clock.now_ns = minute(12)
        log.append([RobotPose(level=0, x=0.0, y=0.0, theta=0.0)])
        for text in "abcd":
            log.annotate(1, "note", text)
        log.observe(1, "open", at=f"@{minute(11)}")
    trimmed = thinned(log.path)

    assert minute(5) == sl.read(trimmed).replay(at=minute(10) - 1).doors[1].last_seen_ns


def test_a_pinned_moment_before_the_horizon_stays_as_it_is_when_the_log_is_thinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sightings of that time which came late are no repeats: what lay between them may be gone."""
    with monkeypatch.context() as short:
        short.setattr(segment_chain, "ROLL_COMMITS", 4)
        log = watched(tmp_path / "log", [(5, "open"), (10, "closed")])
        clock = MinuteClock()
        clock.now_ns = minute(301)
        with sl.append(log, clock=clock, compact=False) as writer:
            writer.pin("then", at=f"@{minute(12)}")
    with sl.append(log, clock=clock, compact=False) as writer:
        for at in (9, 11, 13):
            writer.observe(1, "open", at=f"@{minute(at)}")
    trim_log(log, Retention(LogReader(log), minute(302)))
    asked = [{"at": "pin:then"}]
    before = answers(log, asked)
    assert LogReader(log).horizon

    trim_log(log, Thinning(LogReader(log), minute(400)))

    assert answers(log, asked) == before
