"""Random logs, cared for at random: at each step all answers are those of a plain dictionary."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.domain.doors import DoorMap, DoorState
from semmap_log.domain.events import (
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorObserved,
    DoorPassed,
    DoorRequested,
    DoorUpdated,
    Event,
    HistoryTrimmed,
    MomentPinned,
    Retracted,
    RobotPose,
    SightingsThinned,
)
from semmap_log.door_log.validator import Validator
from semmap_log.errors import CommandError, HorizonError, InvalidEventError
from semmap_log.replay.care import copy, verify
from semmap_log.replay.read_model.indexing import index
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from semmap_log.trimming.redaction import Annotation, Notes, Part, Redaction, Tracks
from semmap_log.trimming.repeated_sightings import Thinning
from semmap_log.trimming.retention import Retention
from semmap_log.trimming.trim_log import TrimmedLog, TrimRule, trim_log
from tests.folds.dictionary_model import ALL, Told, model
from tests.store.trimming.plain_chain import read_plainly
from tests.test_replay import random_event

pytestmark = [
    pytest.mark.filterwarnings(f"ignore::semmap_log.errors.{name}")
    for name in ("HorizonWarning", "KnownLaterWarning", "KeyframeWarning")
]

EXPIRING = (DoorUpdated, DoorObserved, DoorRequested, DoorPassed, RobotPose, SightingsThinned)
DOORS, KEYS = (0, 1, 2, 3), ("a", "b")
ACTORS = ("", "anna", "bert")


class CaredFor:
    """A log, and all that was ever told to it; what is taken out is known here as well."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.dice = random.Random(seed)
        self.clock = SteadyClock()
        self.folder = folder
        self.path = folder / "log"
        self.told: list[Told] = []
        """All events but the annotations that were redacted."""
        self.actors: dict[int, str] = {}
        self.gone: set[int] = set()
        self.thinned: set[int] = set()
        self.pins: dict[str, int] = {}
        self.horizon = 0
        self.done: list[str] = []
        with sl.create(self.path, tz="UTC", clock=self.clock, compact=False) as log:
            for _ in range(30):
                self._append(log)

    def do(self, step: str) -> None:
        """Do what is called so."""
        self.done.append(step)
        getattr(self, step)()

    def open(self) -> sl.DoorLogWriter:
        return sl.append(self.path, clock=self.clock, compact=self.dice.random() < 0.3)

    def write(self) -> None:
        """Append some commits, with late sightings and retractions of what can be."""
        with self.open() as log:
            for _ in range(self.dice.randint(1, 15)):
                self._append(log)

    def _append(self, log: sl.DoorLogWriter) -> None:
        events, actor = list(self._events(log)), self.dice.choice(ACTORS)
        if events:
            log.append(events, note=sl.Note(actor=actor))
            self._take_in(log)

    def _events(self, log: sl.DoorLogWriter) -> Iterator[Event]:
        """Yield some random events that the map lets pass, many of them sightings that repeat."""
        dice, number = self.dice, log.state.event + 1
        validator = Validator(log.door_index, number, past=log.known_past)
        whole = log._reader.first_whole_event
        for _ in range(dice.randint(1, 4)):
            try:
                event = random_event(dice, number, self.clock.now_ns)
                if dice.random() < 0.1:
                    event = RobotPose(x=dice.random(), y=1.0, theta=0.0, level=0)
                elif dice.random() < 0.4:
                    late = {"happened_ns": self.clock.now_ns - dice.randrange(10**8)}
                    event = DoorObserved(
                        door_id=dice.choice(DOORS),
                        state=DoorState.OPEN,
                        **(late if dice.random() < 0.2 else {}),
                    )
                if dice.random() < 0.1:
                    event = DoorAnnotated(
                        door_id=dice.choice(DOORS),
                        key="a",
                        value=dice.choice("xyz"),
                        happened_ns=self.clock.now_ns - dice.randrange(10**8),
                    )
                if isinstance(event, Retracted) and event.first_event < whole:
                    continue
                validator.check(event)
            except (CommandError, InvalidEventError):
                continue
            yield event
            number += 1

    def _take_in(self, log: sl.DoorLog) -> None:
        """Note what was written since, by whomever."""
        last = self.told[-1][0] if self.told else -1
        for commit in log.commits_after(last):
            said = commit.commit
            for one in commit:
                row = (one.number, one.happened_ns, one.recorded_ns, said.recorded_ns, one.event)
                self.told.append(row)
                self.actors[one.number] = said.note.actor

    def commit_ends(self) -> list[int]:
        return [commit.last_event for commit in LogReader(self.path).commits()]

    def redact(self) -> None:
        """Take out notes, tracks and texts up to a random commit, or all."""
        dice, reader = self.dice, LogReader(self.path)
        parts: list[Part] = dice.sample(
            [
                Notes(dice.choice([None, "anna"])),
                Tracks(),
                Annotation(dice.choice(DOORS), dice.choice(KEYS)),
                Annotation(dice.choice(DOORS), dice.choice(KEYS)),
            ],
            dice.randint(1, 3),
        )
        before = dice.choice([reader.last_event(), *self.commit_ends()]) + 1
        self._trim(Redaction.of(reader, parts, before))
        for number, *_, event in list(self.told):
            if number < before and any(is_redacted(part, event) for part in parts):
                self.gone.add(number)
            for part in parts:
                if isinstance(part, Notes) and self.end_of_commit(number) < before:
                    is_meant = part.actor in {None, self.actors[number]}
                    self.actors[number] = "" if is_meant else self.actors[number]
        self.told = [
            one
            for one in self.told
            if not isinstance(one[4], DoorAnnotated) or one[0] not in self.gone
        ]

    def end_of_commit(self, number: int) -> int:
        recorded = next(one[3] for one in self.told if one[0] == number)
        return max(one[0] for one in self.told if one[3] == recorded)

    def thin(self) -> None:
        """Leave out repeated sightings up to a random moment; by the model none is missed."""
        there = set(read_plainly(self.path).events)
        before = [one for one in self.told if one[0] not in self.thinned]
        rule = Thinning(LogReader(self.path), self._random_moment())
        self._trim(rule)
        left = set(read_plainly(self.path).events)
        for number, *_, event in self.told:
            if number in there - left:
                assert isinstance(event, DoorObserved | RobotPose)
                assert number < rule.before
                self.gone.add(number)
                self.thinned.add(number)
        self.check_thinned(before)

    def keep(self) -> None:
        """Move the horizon."""
        until_ns = self._random_moment()
        rule = Retention(LogReader(self.path), until_ns)
        assert rule.horizon >= self.horizon
        assert all(one[3] < until_ns for one in self.told if self.horizon <= one[0] < rule.horizon)
        self._trim(rule)
        self.horizon = LogReader(self.path).horizon
        assert self.horizon <= rule.horizon
        self.gone |= {
            number
            for number, *_, event in self.told
            if number < rule.horizon and isinstance(event, EXPIRING)
        }

    def _random_moment(self) -> int:
        return self.dice.choice([one[3] for one in self.told]) + self.dice.choice([0, 1])

    def _trim(self, rule: TrimRule) -> TrimmedLog:
        done = trim_log(self.path, rule, note=sl.Note(actor="officer"))
        self._take_in(sl.read(self.path))
        return done

    def pin(self) -> None:
        name, at_ns = f"pin {len(self.done)}", self.dice.choice(self.times())
        with self.open() as log:
            try:
                log.pin(name, at=at_ns)
            except HorizonError:
                assert at_ns < self.horizon_ns
                return
            self._take_in(log)

    def compact(self) -> None:
        compact(self.path, merge=self.dice.random() < 0.5, keep_s=self.dice.choice([None, 0]))

    def copy(self) -> None:
        """Go on with the copy."""
        target = self.folder / f"copy {len(list(self.folder.iterdir()))}"
        copy(self.path, target)
        self.path = target

    def index(self) -> None:
        index(self.path)

    @property
    def horizon_ns(self) -> int:
        """When the last event before the horizon was recorded, or later; -1: all is there."""
        found = LogReader(self.path).horizon_ns
        assert found >= max((one[2] for one in self.told if one[0] < self.horizon), default=-1)
        return found

    def times(self) -> list[int]:
        return sorted({time for one in self.told for time in (one[1], one[2], one[3], one[3] - 1)})

    def doors(self, **scope: int | None) -> dict[int, dict[str, Any]]:
        """Return what the doors are, by what thinning has left."""
        return model([one for one in self.told if one[0] not in self.thinned], **scope)

    def check_thinned(self, before: list[Told]) -> None:
        """Check that no question about states could tell that the log is thinned."""
        for _ in range(30):
            at, known_at = (self.dice.choice([None, *self.times()]) for _ in range(2))
            was, now = model(before, at, known_at), self.doors(at=at, known_at=known_at)
            assert [(i, door["state"]) for i, door in was.items()] == [
                (i, door["state"]) for i, door in now.items()
            ]

    def check(self) -> None:
        """Compare each answer with that of the model."""
        found = verify(self.path)
        told = [
            one for one in found.findings if one.severity and one.kind not in {"leftover", "index"}
        ]
        assert not told, told
        plain = read_plainly(self.path)
        assert set(plain.events) == {one[0] for one in self.told if one[0] not in self.gone}
        log, horizon_ns, last = sl.read(self.path), self.horizon_ns, self.told[-1][0]
        assert LogReader(self.path).horizon == self.horizon
        for _ in range(14):
            at, known_at = (self.dice.choice([None, *self.times()]) for _ in range(2))
            event = self.dice.choice([None, self.dice.randrange(last + 1)])
            self._check_replay(log, horizon_ns, at, known_at, event)
        hidden = hidden_in(self.told)
        self.pins = {
            event.name: event.at_ns
            for number, *_, event in self.told
            if isinstance(event, MomentPinned) and number not in hidden | self.gone
        }
        for name, at in self.pins.items():
            self._check_doors(log.replay(at=f"pin:{name}"), at=at)
        self._check_history(log)
        for door in {one[4].door_id for one in self.told if isinstance(one[4], DoorAdded)}:
            self._check_timeline(log, horizon_ns, door)

    def _check_replay(
        self, log: sl.DoorLog, horizon_ns: int, at: int | None, known_at: int | None,
        event: int | None,
    ) -> None:  # fmt: skip
        try:
            doors = log.replay(at=at, known_at=known_at, event=event)
        except HorizonError:
            is_early = any(time is not None and time < horizon_ns for time in (at, known_at))
            assert is_early or (event is not None and event + 1 < self.horizon)
            return
        assert known_at is None or known_at >= horizon_ns
        assert event is None or event + 1 >= self.horizon
        assert at is None or at >= horizon_ns or at in self.pins.values()
        self._check_doors(doors, at=at, known_at=known_at, event=event)

    def _check_doors(self, doors: DoorMap, **scope: int | None) -> None:
        found = [
            {name: getattr(door, name) for name in ALL}
            | {"door": int(door.door_id), "said": dict(door.annotations)}
            | ({} if self.thinned else {"seen": door.last_seen_ns})
            for door in doors.doors.values()
        ]
        expected = [self._row(*row) for row in self.doors(**scope).items()]
        assert repr(found) == repr(expected), scope

    def _row(self, door_id: int, door: dict[str, Any]) -> dict[str, Any]:
        said = {key: value for key, value in sorted(door["said"].items()) if value}
        row = {name: door[name] for name in ALL} | {"door": door_id, "said": said}
        return row if self.thinned else row | {"seen": door["seen"]}

    def _check_history(self, log: sl.DoorLog) -> None:
        hidden = hidden_in(self.told)
        expected = [
            (number, repr(replace(event, happened_ns=happened)), self.actors[number],
             number in hidden, event)
            for number, happened, _, _, event in self.told
            if number not in self.gone
        ]  # fmt: skip
        found = [(h.number, repr(h.event), h.actor, h.retracted) for h in log.history()]
        assert found == [one[:4] for one in expected]
        for door in DOORS:
            found = [(h.number, repr(h.event), h.actor, h.retracted) for h in log.history(door)]
            assert found == [
                one[:4]
                for one in expected
                if isinstance(one[4], DoorEvent) and one[4].door_id == door
            ]

    def _check_timeline(self, log: sl.DoorLog, horizon_ns: int, door: int) -> None:
        known_at = self.dice.choice([None, *self.times()])
        try:
            line = log.timeline(door, known_at=known_at)
        except HorizonError:  # also where all that was known then is gone
            assert known_at is not None
            by_ns = max(known_at, horizon_ns)
            known = (one[0] for one in self.told if one[3] <= by_ns and one[0] not in self.gone)
            assert max(known, default=-1) < self.horizon
            return
        found = list(line)
        end_ns = log.end_ns() if known_at is None else known_at
        for at in self.dice.sample(self.times(), 12):
            if horizon_ns <= at <= end_ns:
                told = [one.state for one in found if one.start_ns <= at < one.end_ns]
                if not line.removed:
                    told += [one.state for one in found[-1:] if one.end_ns == at]
                state = self.doors(at=at, known_at=known_at).get(door, {}).get("state")
                assert (told[0] if told else None) == state, (at, known_at, door)


def is_redacted(part: Part, event: Event) -> bool:
    if isinstance(part, Tracks):
        return isinstance(event, RobotPose)
    if isinstance(part, Annotation) and isinstance(event, DoorAnnotated):
        return (event.door_id, event.key) == (part.door_id, part.key)
    return isinstance(part, Annotation) and isinstance(event, MomentPinned)


def hidden_in(told: Sequence[Told]) -> set[int]:
    retractions = {number: event for number, *_, event in told if isinstance(event, Retracted)}
    ranges = [range(one.first_event, one.last_event + 1) for one in retractions.values()]
    alone = {numbers[0] for numbers in ranges if len(numbers) == 1}
    about_the_log = {
        number for number, *_, event in told if isinstance(event, (HistoryTrimmed, MomentPinned))
    }
    return {n for numbers in ranges for n in numbers} - retractions.keys() - about_the_log | (
        alone & about_the_log
    )


STEPS = ("write", "write", "redact", "thin", "keep", "pin", "compact", "copy", "index")


def care_for_at_random(folder: Path, seed: int, patch: pytest.MonkeyPatch, steps: int) -> None:
    patch.setattr(segment_chain, "ROLL_COMMITS", random.Random(seed).choice([4, 9, 15]))
    log = CaredFor(folder, seed)
    patch.setattr("semmap_log.door_log.opening.SystemClock", lambda: log.clock)
    log.check()
    for _ in range(steps):
        log.do(log.dice.choice(STEPS))
        log.check()


@pytest.mark.parametrize("seed", range(4))
def test_whatever_care_was_taken_the_answers_are_those_of_a_dictionary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """
    At any moment, by what is known today and by what was known then; or the stated error.
    """
    care_for_at_random(tmp_path, seed, monkeypatch, steps=6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 115))
def test_whatever_care_was_taken_for_long_the_answers_are_those_of_a_dictionary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """
    The same, with more of it.
    """
    care_for_at_random(tmp_path, seed, monkeypatch, steps=20)
