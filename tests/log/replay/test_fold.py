"""Folding a log with a projection of one's own: any moment, from the start or from a checkpoint."""

from __future__ import annotations

import inspect
import itertools
import random
import re
import textwrap
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import reduce
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.folds import projection as projection_module
from semmap_log.core.folds.projection import Dumping, Mergeable
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorObserved, Retracted
from semmap_log.log.replay.state import Checkpoint
from semmap_log.store.compaction import compact
from semmap_log.store.writing import segment_chain
from tests.log.replay.projections import Digest, Numbers, Sums
from tests.test_replay import random_log

ROOT = Path(__file__).parents[3]


def dump(state: Any) -> str:
    """Return a state as text."""
    return repr(state)


def expected_numbers(log: sl.DoorLog, limit: int | None = None) -> list[int]:
    """Return the numbers of the events that count, by the plainest of ways."""
    events = [
        one
        for batch in log._reader.batches()
        for one in batch
        if limit is None or one.number <= limit
    ]
    hidden = {
        number
        for one in events
        if isinstance(one.event, Retracted)
        for number in range(one.event.first_event, one.event.last_event + 1)
    }
    return [
        one.number for one in events if one.number not in hidden or isinstance(one.event, Retracted)
    ]


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> sl.DoorLog:
    """A random log of several segments, with retractions and late events."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 9)
    random_log(tmp_path / "log", random.Random(5), commits=60)
    return sl.read(tmp_path / "log")


def test_the_example_in_the_docstring_does_what_it_says(tmp_path: Path) -> None:
    """Its code, run as it stands."""
    text = inspect.getdoc(projection_module) or ""
    code = textwrap.dedent(re.search(r"\n\n((?:    .*\n|\n)+)", text)[1])
    names: dict[str, Any] = {"OPEN": sl.DoorState.OPEN, "CLOSED": sl.DoorState.CLOSED}
    exec(code, names)
    with sl.create(tmp_path / "log", tz="UTC") as log:
        front, back = log.add_door(), log.add_door()
        for state in ("open", "closed", "open", "open", "closed"):
            log.observe(front, state)
        log.observe(back, "closed")

        first = log.fold(names["Openings"](), checkpoint=tmp_path / "openings")
        log.observe(front, "open")
        log.observe(back, "open")
        second = log.fold(names["Openings"](), checkpoint=tmp_path / "openings")

    assert {front: 1} == first["times"]
    assert Counter({front: 2, back: 1}) == second["times"]
    assert 15 >= len([line for line in code.splitlines() if line.strip()])


def test_batches_come_in_order_and_without_retracted_events(log: sl.DoorLog) -> None:
    """Every event that counts, once; each `initial` is a new one."""
    projection = Numbers()

    numbers = log.fold(projection)

    assert expected_numbers(log) == numbers
    assert numbers == log.fold(projection)
    assert len(numbers) < log._reader.last_commit().last_event + 1


@pytest.mark.parametrize(
    "projection", [Numbers(), Sums(), Digest()], ids=lambda p: type(p).__name__
)
def test_every_moment_with_and_without_a_checkpoint(
    log: sl.DoorLog, tmp_path: Path, projection: Any
) -> None:
    """A checkpoint of any moment leads to the state that a fold from the start gives."""
    dice = random.Random(1)
    commits = list(log.commits())
    times = [t for commit in commits for t in (commit.recorded_ns, commit.recorded_ns - 1)]
    path = tmp_path / "checkpoint"

    for _ in range(60):
        scope = {
            dice.choice(("at", "known_at", "event")): dice.choice([None, *times]),
            "event": dice.choice([None, None, dice.randrange(commits[-1].last_event + 1)]),
        }
        if dice.random() < 0.1:
            path.unlink(missing_ok=True)

        with_checkpoint = log.fold(projection, **scope, checkpoint=path, save_every_s=0)

        assert dump(log.fold(projection, **scope)) == dump(with_checkpoint), scope


def test_an_earlier_question_leaves_a_later_checkpoint_alone(
    log: sl.DoorLog, tmp_path: Path
) -> None:
    """Nor does one about what had happened by some time write one."""
    path = tmp_path / "checkpoint"
    log.fold(Numbers(), at="@1772400000.020", checkpoint=path)
    assert not path.exists()
    log.fold(Numbers(), checkpoint=path)
    before = path.read_bytes()

    log.fold(Numbers(), event=7, checkpoint=path)
    log.fold(Numbers(), at="@1772400000.020", checkpoint=path)

    assert before == path.read_bytes()


def test_states_of_two_parts_make_that_of_both(log: sl.DoorLog) -> None:
    """For every cut, though retractions of the first part may lie in the second."""
    projection, last = Numbers(), log._reader.last_commit().last_event
    whole = log.fold(projection)

    for cut in range(-1, last + 1):
        earlier = log.fold_part(projection, 0, cut)
        later = log.fold_part(projection, cut + 1, last)

        assert whole == projection.merge(earlier, later)


@pytest.mark.slow
def test_parts_may_be_made_by_several_processes(log: sl.DoorLog) -> None:
    """Each opens the log by itself; the parts come back in order."""
    last = log._reader.last_commit().last_event
    cuts = [0, last // 3, 2 * last // 3, last + 1]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as processes:
        parts = processes.map(_part, repeat(log.path), cuts, cuts[1:])

    assert log.fold(Numbers()) == reduce(Numbers().merge, parts)


def _part(path: Path, first: int, behind: int) -> list[int]:
    return sl.read(path).fold_part(Numbers(), first, behind - 1)


def test_what_a_projection_offers_is_seen() -> None:
    """`merge`, `dump` and `load` are there or not: nobody inherits from anything."""
    assert isinstance(Numbers(), Mergeable)
    assert not isinstance(Sums(), Mergeable)
    assert isinstance(Digest(), Dumping)
    assert not isinstance(Sums(), Dumping)


def test_compaction_does_not_move_a_position(tmp_path: Path) -> None:
    """It goes on in the middle of a chunk of merged segments."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as log:
        door = log.add_door()
        for i in range(200):
            log.observe(door, "open" if i & 1 else "closed")
    half = sl.read(path).fold(Numbers(), event=100, checkpoint=tmp_path / "checkpoint")
    compact(path)

    counting = _Counting()
    numbers = sl.read(path).fold(counting, checkpoint=tmp_path / "checkpoint")

    assert list(range(101)) == half
    assert list(range(201)) == numbers
    assert 100 == counting.applied


class _Counting(Numbers):
    """Numbers that says how many events it was given."""

    name = "Numbers"
    applied = 0

    def apply(self, state: list[int], batch: Any) -> list[int]:
        self.applied += len(batch)
        return super().apply(state, batch)


def test_one_commit_of_many_pages_is_kept_when_it_is_whole(tmp_path: Path) -> None:
    """On the way through it there is no end of a commit to save at."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        door = DoorId(log.add_door())
        log.append(DoorObserved(door_id=door, state=sl.DoorState.OPEN) for _ in range(40_000))
        log.observe(door, "closed")
    checkpoint = tmp_path / "checkpoint"

    opened = sl.read(path)
    counts = opened.fold(Sums(), event=20_000, checkpoint=checkpoint, save_every_s=0)

    assert 20_000 == counts["seen"].sum()
    assert b'"event": 0,' in checkpoint.read_bytes()
    assert 40_001 == opened.fold(Sums(), checkpoint=checkpoint, save_every_s=0)["seen"].sum()
    assert b'"event": 40001,' in checkpoint.read_bytes()


@pytest.mark.slow
def test_a_fold_that_is_torn_off_goes_on_from_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was saved is the state of the end of a commit."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 4)
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        door = log.add_door(name="front")
        for i in range(40):
            log.observe(door, "open")
            if i == 20:
                log.append([Retracted(first_event=15, last_event=15)])
    log, path, saved = sl.read(tmp_path / "log"), tmp_path / "checkpoint", set()

    for bad in range(43):
        path.unlink(missing_ok=True)
        with pytest.raises(ZeroDivisionError):
            log.fold(_FailingAt(bad), checkpoint=path, save_every_s=0)
        if path.exists():
            saved.add(event := int(re.search(rb'"event": (\d+)', path.read_bytes())[1]))
            kept = Checkpoint(path, Numbers(), log._reader).load(log._reader)
            assert kept is not None
            assert log.fold(Numbers(), event=event) == kept[1]

        assert expected_numbers(log) == log.fold(Numbers(), checkpoint=path)

    assert {4, 8, 12} < saved
    assert not saved & set(range(15, 23))


@pytest.mark.parametrize("checkpoint", [None, "checkpoint"])
def test_what_is_written_meanwhile_does_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, checkpoint: str | None
) -> None:
    """A fold is of its beginning, though another thread writes, retracts and asks."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 4)
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        door = log.add_door()
        for _ in range(20):
            log.observe(door, "open")
        numbers = itertools.count(1)

        class Disturbed(Numbers):
            def apply(self, state: list[int], batch: Any) -> list[int]:
                log.retract(log.observe(door, "closed").first_event)
                log.retract(next(numbers))
                log.refresh()
                return super().apply(state, batch)

        kept = None if checkpoint is None else tmp_path / checkpoint

        assert list(range(21)) == log.fold(Disturbed(), checkpoint=kept)


class _FailingAt(Numbers):
    """Numbers that stumbles when it sees an event behind a number, its state half made."""

    name = "Numbers"

    def __init__(self, number: int) -> None:
        self.number = number

    def apply(self, state: list[int], batch: Any) -> list[int]:
        state += batch.number.tolist()
        return state if np.all(batch.number < self.number) else state[1 // 0]
