"""A command that is sent again is stored once: however long ago, whatever became of its segment."""

from __future__ import annotations

import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, Event
from semmap_log.errors import CommandReusedError, CorruptLogError
from semmap_log.log.replay.maintenance import recover
from semmap_log.store import command_index
from semmap_log.store.command_index import fingerprint
from semmap_log.store.compaction import compact
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading import command_rows
from semmap_log.store.writing import segment_chain
from semmap_log.store.writing.segment_chain import CommandMemory
from tests.conftest import SteadyClock
from tests.store.eventful import flip
from tests.store.logs import close_as_before

DOOR = DoorId(1)


def an_id(number: int) -> bytes:
    return number.to_bytes(16, "big")


def sighting(number: int) -> list[Event]:
    """Return what command `number` asks for; no two are the same."""
    state, accuracy = DoorState(number % 3), 0.5 + number % 997 / 2000
    return [DoorObserved(door_id=DOOR, state=state, accuracy_open=accuracy)]


def send(log: sl.DoorLogWriter, number: int) -> int:
    """Send a command; return the event that it became."""
    return log.append(sighting(number), command_id=an_id(number), sync=False).commit.first_event


def made(path: Path, commands: range, *, compacts: bool = False) -> dict[int, int]:
    """Make a log of a door and these commands; return the event of each."""
    with sl.create(path, tz="UTC", clock=SteadyClock(), compact=compacts) as log:
        log.append([DoorAdded(door_id=DOOR)])
        return {number: send(log, number) for number in commands}


def memory(log: sl.DoorLogWriter) -> CommandMemory:
    return log._writer._commands


@pytest.fixture
def rolls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Segments of five commits, none of them continued."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 5)
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 0)


def as_it_is(_: Path) -> None:
    pass


def with_damaged_indexes(path: Path) -> None:
    """Flip a bit in the index of each segment that has one."""
    for file in path.glob("*.mcap"):
        flip(file, file.read_bytes().find(b"semmap_commands") + 60)


@pytest.mark.parametrize(
    "change",
    [as_it_is, lambda path: compact(path, merge=False), compact, close_as_before,
     with_damaged_indexes],
    ids=["as written", "compacted", "merged", "without an index", "index damaged"],
)  # fmt: skip
@pytest.mark.usefixtures("rolls")
def test_every_command_is_found_after_rolls_and_a_reopening(
    change: Callable[[Path], None], tmp_path: Path
) -> None:
    """In whatever form its segment is: the commit that is stored, with its note."""
    path = tmp_path / "log"
    events = made(path, range(100, 118))
    change(path)

    with sl.append(path, compact=False) as log:
        for number, event in events.items():
            found = log.find_command(an_id(number))
            assert found is not None
            assert (event, an_id(number)) == (found.first_event, found.command_id)
            assert found == log._reader.commit_at(event)
            assert event == send(log, number)
        assert [] == [n for n in range(100) if log.find_command(an_id(n)) is not None]
        assert max(events.values()) + 1 == send(log, 1)


def test_an_id_drawn_at_random_can_be_asked_for(tmp_path: Path, rolls: None) -> None:
    """As LogPoisonedError tells it: whether the command was stored shows after reopening."""
    path = tmp_path / "log"
    drawn: list[bytes] = []

    def entropy(count: int) -> bytes:
        drawn.append(os.urandom(count))
        return drawn[-1]

    with sl.create(path, tz="UTC", entropy=entropy, compact=False) as log:
        log.append([DoorAdded(door_id=DOOR)])
        commits = [log.append(sighting(number)).commit for number in range(12)]
        before = [log.find_command(commit.command_id) for commit in commits]

    with sl.append(path) as log:
        assert commits == before == [log.find_command(c.command_id) for c in commits]
    assert {commit.command_id for commit in commits} <= set(drawn)


@pytest.mark.parametrize("loses", [False, True], ids=["torn closing", "lost middle"])
@pytest.mark.usefixtures("rolls")
def test_after_recover_commands_are_known(loses: bool, tmp_path: Path) -> None:
    """All that are left of a log that lost its middle; those that were lost are stored anew."""
    path = tmp_path / "log"
    made(path, range(18))
    _, second, *_, last = sorted(path.glob("*.mcap"))
    if loses:
        flip(second, second.read_bytes().find(an_id(5)))
        recover(path)
    else:
        last.write_bytes(last.read_bytes()[:-300])
    with sl.append(path, compact=False) as log:
        stored = {commit.command_id: commit.first_event for commit in log._reader.commits()}
        lost = [number for number in range(18) if an_id(number) not in stored]
        end = log.state.event + 1

        assert {n: send(log, n) for n in range(18) if n not in lost} == {
            n: stored[an_id(n)] for n in range(18) if n not in lost
        }
        assert [end + i for i in range(len(lost))] == [send(log, n) for n in lost]
    assert ([5] if loses else []) == lost


def test_commands_with_one_fingerprint_are_told_apart(
    tmp_path: Path, rolls: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fingerprint only says where to look: here all have the same."""
    for module in (command_index, segment_chain):
        monkeypatch.setattr(module, "fingerprint", lambda _: 2**32 - 1)
    path = tmp_path / "log"
    events = made(path, range(18))

    with sl.append(path, compact=False) as log:
        assert events == {number: send(log, number) for number in events}
        assert log.find_command(an_id(18)) is None


def test_nothing_is_read_until_a_command_with_an_id_comes(
    tmp_path: Path, rolls: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Appends without an id, rolls and closing open no segment for them."""
    path = tmp_path / "log"
    made(path, range(18))
    asked: list[Path] = []

    def look(segment) -> object:
        asked.append(segment.path)
        return rows_of(segment)

    rows_of = command_rows.rows_of
    monkeypatch.setattr(segment_chain, "rows_of", look)
    with sl.append(path, compact=False) as log:
        for number in range(20):
            log.append(sighting(number))
        assert (None, {}) == (memory(log)._stored, memory(log)._known)
        assert [] == asked
        log.find_command(an_id(3))

        assert sorted(set(asked)) == asked  # each closed segment once
        log.find_command(an_id(99))
        send(log, 3)
        assert len(list(path.glob("*.mcap"))) - 1 == len(asked)


@pytest.mark.slow
def test_memory_is_bounded_by_the_segment_and_eight_bytes_a_commit(tmp_path: Path) -> None:
    """Over 61,000 commits: ids of the live segment only, numbers for the rest."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", durability="none", compact=False) as log:
        log.append([DoorAdded(door_id=DOOR)])
        first = send(log, 1)
        for _ in range(6):
            for _ in range(10_000):
                log.append(sighting(2))
            assert log.find_command(an_id(99)) is None
            assert len(memory(log)._known) <= segment_chain.ROLL_COMMITS
        kept = memory(log)._stored

        assert 60_002 == len(kept) + len(memory(log)._known)
        assert 8 * len(kept) == kept._rows.nbytes
        assert first == send(log, 1)
    with sl.append(path, compact=False) as log:
        assert first == send(log, 1)
        assert 60_002 == log.state.event + 1


def test_numbers_beyond_32_bits_are_found(tmp_path: Path) -> None:
    """The memory holds the low half of an event's number."""
    first = 3 * 2**32 - 2
    rows = command_index.command_rows(
        an_id(1) + an_id(2), np.array([first, first + 5], np.uint64), first
    )
    kept = segment_chain.StoredCommands(LogFolder(tmp_path), [])
    kept.add("x", first, rows)

    assert [first, first - 2**32, first - 2 * 2**32] == list(kept._events(fingerprint(an_id(1))))
    assert first + 5 == next(kept._events(fingerprint(an_id(2))))


def test_a_damaged_commit_is_an_error_not_a_second_one(tmp_path: Path, rolls: None) -> None:
    """The command may be stored, so it is not stored again."""
    path = tmp_path / "log"
    events = made(path, range(18))
    second = sorted(path.glob("*.mcap"))[1]
    at = second.read_bytes().find(an_id(6))
    flip(second, at)

    with sl.append(path, compact=False) as log:
        with pytest.raises(CorruptLogError, match=second.name):
            send(log, 6)
        assert max(events.values()) == log.state.event
        assert events[12] == send(log, 12)


class Commands(RuleBasedStateMachine):
    """A log beside a plain dict: command -> event."""

    @initialize(seed=st.integers(0, 2**16))
    def begin(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.patch = pytest.MonkeyPatch()
        self.patch.setattr(segment_chain, "ROLL_COMMITS", 4)
        self.patch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", self.random.choice([0, 2**20]))
        self.folder = Path(os.environ.get("PYTEST_DEBUG_TEMPROOT", "/tmp")) / (
            f"semmap_commands_{os.getpid()}"
        )
        shutil.rmtree(self.folder, ignore_errors=True)
        self.path = self.folder / "log"
        self.clock = SteadyClock()
        self.log = sl.create(
            self.path, tz="UTC", clock=self.clock, compact=False, durability="none"
        )
        self.log.append([DoorAdded(door_id=DOOR)])
        self.known: dict[int, int] = {}
        self.end = 1

    @rule(number=st.integers(0, 40))
    def send_one(self, number: int) -> None:
        event = send(self.log, number)
        if number not in self.known:
            self.known[number], self.end = self.end, self.end + 1
        assert event == self.known[number]

    @rule(number=st.integers(0, 40))
    def ask(self, number: int) -> None:
        found = self.log.find_command(an_id(number))
        assert self.known.get(number) == (None if found is None else found.first_event)

    @rule(number=st.integers(0, 40))
    def reuse(self, number: int) -> None:
        if number in self.known:
            with pytest.raises(CommandReusedError):
                self.log.append(sighting(number + 41), command_id=an_id(number))

    @rule(count=st.integers(1, 6))
    def append_without_id(self, count: int) -> None:
        for i in range(count):
            self.log.append(sighting(i))
        self.end += count

    @rule()
    def roll(self) -> None:
        self.log._writer._chain.roll(self.log._writer._end)

    @rule()
    def reopen(self) -> None:
        self.log.close()
        self._open()

    @rule()
    def crash(self) -> None:
        if self.log._writer._chain.live is not None:
            self.log.sync()
        copy = self.folder / "copy"
        shutil.copytree(self.path, copy)
        self.log.close()
        shutil.rmtree(self.path)
        copy.rename(self.path)
        self._open()

    @rule(merge=st.booleans())
    def compact(self, merge: bool) -> None:
        self.log.close()
        compact(self.path, merge=merge)
        self._open()

    @rule()
    def age(self) -> None:
        self.log.close()
        close_as_before(self.path)
        self._open()

    @precondition(lambda self: self.end > 1)
    @rule()
    def recover(self) -> None:
        """
        A head is damaged, but no commit: all of them come back, under the same numbers.
        """
        self.log.close()
        (first, *_) = sorted(self.path.glob("*.mcap"))
        flip(first, first.read_bytes().find(b"hash_so_far") + 20)
        recover(self.path, clock=self.clock)
        self._open()
        self.end += 1  # the commit that tells of it
        assert self.end == self.log.state.event + 1

    def teardown(self) -> None:
        if hasattr(self, "log"):
            self.log.close()
            self.patch.undo()
            shutil.rmtree(self.folder, ignore_errors=True)

    def _open(self) -> None:
        self.log = sl.append(self.path, clock=self.clock, compact=False, durability="none")


TestCommands = Commands.TestCase
TestCommands.settings = settings(max_examples=25, stateful_step_count=25)
