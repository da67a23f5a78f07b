"""Which source events are from: as their commits' notes say, however the log is read."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, DoorObserved, DoorPassed

SOURCES = ["", "tug1", "tug2", "Türsensor 7", "x" * 300]
KINDS = (DoorObserved, DoorPassed)


def observed(count: int) -> EventBatch:
    state = np.full(count, DoorState.OPEN, np.uint8)
    return EventBatch.of(DoorObserved, door_id=np.uint32(1), state=state)


def appended(folder: Path, dice: random.Random, *, compact: bool) -> Path:
    """Write commits with and without notes, of one event and of more than a chunk holds."""
    path = folder / "log"
    with sl.create(path, tz="UTC", durability="none", compact=compact) as log:
        log.append([DoorAdded(door_id=DoorId(1))])
        for _ in range(60):
            source = dice.choice(SOURCES)
            reason = dice.choice(["", "round 1", "round 2"])
            events = dice.choice([
                [DoorPassed(door_id=DoorId(1), passed=True)],
                [DoorAnnotated(door_id=DoorId(1), key="name", value="front")],
                observed(3),
                observed(1),
                observed(30_000),
            ])  # fmt: skip
            if isinstance(events, EventBatch) and len(events) > 3 and dice.random() < 0.8:
                continue
            log.append(events, note=Note(actor="me", source=source, reason=reason))
    return path


def told(batches: Iterator[EventBatch]) -> dict[int, str]:
    """Return event number -> source."""
    found: dict[int, str] = {}
    for batch in batches:
        for kind in KINDS:
            codes, names = batch.sources(kind)
            numbers = batch.number[batch.where(kind)].tolist()
            found |= dict(zip(numbers, [names[code] for code in codes.tolist()], strict=True))
    return found


@pytest.mark.parametrize("seed", range(4))
def test_sources_are_what_the_notes_of_the_commits_say(tmp_path: Path, seed: int) -> None:
    """The whole log, and windows of it that leave chunks out, in which a commit's end may lie."""
    dice = random.Random(seed)
    log = sl.read(appended(tmp_path, dice, compact=seed % 2 == 0))
    expected = {
        number: commit.note.source
        for commit in log.commits()
        for number in range(commit.first_event, commit.last_event + 1)
    }
    last = log.replay().event

    whole = told(log.batches())
    passed = told(log.batches(kinds=[DoorPassed]))
    first = dice.randint(0, last)
    part = told(log.batches(f"event:{first}", f"event:{dice.randint(first, last) + 1}"))

    assert len({whole[number] for number in whole}) > 2
    for found in (whole, passed, part):
        assert {number: expected[number] for number in found} == found


def test_sources_stay_with_events_that_are_chosen(tmp_path: Path) -> None:
    """Selected, split, cut into parts."""
    log = sl.read(appended(tmp_path, random.Random(5), compact=False))
    whole = told(log.batches())

    for batch in log.batches():
        some = batch.select(batch.number % 3 == 0)
        parts = [*some.parts(7), *batch.split(len(batch) // 2)]
        found = told(iter(parts))

        assert {number: whole[number] for number in found} == found


def test_events_that_are_in_no_log_have_no_source() -> None:
    """The empty name, and no error."""
    codes, names = observed(2).sources(DoorObserved)

    assert ["", ""] == [names[code] for code in codes.tolist()]
    assert 0 == len(observed(2).sources(DoorPassed)[0])
