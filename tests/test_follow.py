"""Following a log: every commit once, in order, whatever becomes of the files meanwhile."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorAnnotated, DoorObserved
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.store.compaction import compact
from semmap_log.store.reading.following import FollowedCommit
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.writing import segment_chain
from tests.calls import MOST_CALLS_A_LOOK, calls_of


def _all_there(log: sl.DoorLog, after: int | None = -1) -> list[FollowedCommit]:
    return list(log.follow(after, poll_s=0, stop=lambda: True))


def _numbers(commits: list[FollowedCommit]) -> list[int]:
    return [recorded.number for commit in commits for recorded in commit]


@pytest.fixture
def rolled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log of several segments: 12 commits, two events in every third."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 5)
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        for i in range(12):
            log.add_door(name=f"door {i}" if i % 3 == 0 else "")
    return path


def test_commits_come_with_their_events(rolled: Path) -> None:
    """From the beginning: the same commits and events as asked for all at once."""
    log = sl.read(rolled)

    followed = _all_there(log)

    assert list(log.commits()) == [one.commit for one in followed]
    assert list(map(str, chain.from_iterable(log.batches()))) == list(
        map(str, chain.from_iterable(followed))
    )  # as text, since NaN is not equal to itself
    assert [2, 1, 1, 2] == [len(one.batch) for one in followed[:4]]
    assert all(one.commit.count == len(one.batch) for one in followed)


@pytest.mark.parametrize("after", range(-1, 17))
def test_a_position_is_an_event_number(rolled: Path, after: int) -> None:
    """Behind every number exactly the rest comes, also in the middle of a commit and at the end."""
    log = sl.read(rolled)

    numbers = _numbers(_all_there(log, after))

    assert list(range(after + 1, 16)) == numbers


def test_by_default_only_what_is_new_comes(rolled: Path) -> None:
    """New counts from the end of the log as it was opened, not from when it was first asked."""
    log = sl.read(rolled)
    assert [] == _all_there(log, None)
    with sl.append(rolled) as writing:
        writing.add_door()

    numbers = _numbers(_all_there(log, None))

    assert [16] == numbers


def test_an_import_of_several_chunks_comes_whole(tmp_path: Path) -> None:
    """One commit of some MiB is one commit here, texts and fixed-size events in their order."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        door = log.add_door()
        events = [
            DoorAnnotated(door_id=door, key="k", value="v" * 900)
            if i % 10 == 0
            else DoorObserved(door_id=door, state=sl.DoorState.OPEN)
            for i in range(20_000)
        ]
        log.append(events)

    first, second = _all_there(sl.read(path))

    assert 3 < len(sl.read(path)._reader.segments[0].chunks)
    assert (1, 20_000) == (len(first.batch), len(second.batch))
    assert [type(event) for event in events] == [type(recorded.event) for recorded in second]


def test_nothing_is_seen_of_an_unfinished_commit(tmp_path: Path) -> None:
    """While an import is under way its chunks are on the disk already."""
    path = tmp_path / "log"
    seen: list[int] = []
    with sl.create(path, tz="UTC") as log:
        door = log.add_door()

        def events() -> Iterator[DoorObserved]:
            for i in range(30_000):
                if i == 25_000:
                    seen.append(len(_numbers(_all_there(sl.read(path)))))
                yield DoorObserved(door_id=door, state=sl.DoorState.OPEN)

        log.append(events())
        after = len(_numbers(_all_there(sl.read(path))))

    assert ([1], 30_001) == (seen, after)


def test_compaction_while_following(rolled: Path) -> None:
    """Segments are exchanged in the middle of the reading."""
    expected = _numbers(_all_there(sl.read(rolled)))
    following = sl.read(rolled).follow(-1, poll_s=0, stop=lambda: True)
    numbers = _numbers(list(islice(following, 3)))

    compact(rolled)
    numbers += _numbers(list(following))
    again = _numbers(_all_there(sl.read(rolled), 6))

    assert expected == numbers
    assert expected[7:] == again


@pytest.mark.parametrize("more", [0, 1, 2])
def test_a_log_that_was_put_back_is_noticed(rolled: Path, tmp_path: Path, more: int) -> None:
    """The backup ends before what was read, at the same number, or behind it."""
    backup = tmp_path / "backup"
    shutil.copytree(rolled, backup)
    for path, count in ((rolled, 1), (backup, more)):
        with sl.append(path) as log:
            for _ in range(count):
                log.add_door()
    following = sl.read(rolled).follow(14, poll_s=0)
    assert [15] == [recorded.number for recorded in next(following)]
    assert [16] == [recorded.number for recorded in next(following)]

    shutil.rmtree(rolled)
    backup.rename(rolled)

    with pytest.raises(
        CorruptLogError, match=r"the commit before event 17, which was there before"
    ):
        next(following)


def test_an_older_state_of_a_segment_is_noticed_from_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who waits for what comes behind the segment before it is not told that nothing does."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 5)
    path, early, name = tmp_path / "log", tmp_path / "early", "log_000001.mcap"
    with sl.create(path, tz="UTC") as log:
        for count in range(11):
            log.add_door()
            if count == 5:
                shutil.copytree(path, early)
    os.truncate(early / name, open_segment(early / name).chunks[-1].offset)
    sl.append(early).close()  # and so it was closed without a commit
    shutil.copy(early / name, path / name)

    with pytest.raises(CorruptLogError, match="one of the two is not what"):
        _all_there(sl.read(path), after=4)


def test_another_log_in_its_place_is_noticed(rolled: Path) -> None:
    """The numbers would go on as if nothing were wrong."""
    following = sl.read(rolled).follow(14, poll_s=0)
    next(following)
    shutil.rmtree(rolled)
    with sl.create(rolled, tz="UTC") as log:
        for _ in range(20):
            log.add_door()

    with pytest.raises(LogError, match="the log was replaced by another one"):
        next(following)


WRITER = """
import sys, itertools
import semmap_log as sl
from semmap_log.store.writing import segment_chain
segment_chain.ROLL_COMMITS = 7
log = sl.append(sys.argv[1])
door = next(iter(log.replay().doors))
for i in itertools.count():
    log.observe(door, "open" if i & 1 else "closed")
    if i % 11 == 0:
        log.annotate(door, "key", "x" * i)
    print(log.state.event, flush=True)
"""


def _run_writer(path: Path, *, at_least: int) -> int:
    """Let a process append until so many events are there, kill it, return its last answer."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    last = -1
    for line in process.stdout:
        last = int(line)
        if last >= at_least:
            break
    process.send_signal(signal.SIGKILL)
    last = max([last, *(int(line) for line in process.stdout if line.strip())])
    process.stdout.close()
    process.wait()
    return last


@pytest.mark.slow
def test_following_a_writer_that_is_killed_again_and_again(tmp_path: Path) -> None:
    """Three followers, over rolls, SIGKILLs, recoveries, compactions and restarts."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door(name="front")
    done = threading.Event()
    seen: list[list[int]] = [[], [], []]
    hashes: list[list[bytes]] = [[], [], []]
    errors: list[BaseException] = []

    def follow(i: int) -> None:
        try:
            for one in sl.read(path).follow(-1, poll_s=0.001 * 10**i, stop=done.is_set):
                seen[i] += [recorded.number for recorded in one]
                hashes[i].append(one.commit.hash)
        except BaseException as error:  # noqa: BLE001 - shown below
            errors.append(error)

    followers = [threading.Thread(target=follow, args=(i,)) for i in range(3)]
    for follower in followers:
        follower.start()
    acknowledged = 1
    for round_ in range(4):
        acknowledged = _run_writer(path, at_least=acknowledged + 30)
        if round_ % 2:
            sl.append(path).close()
            compact(path)
    done.set()
    for follower in followers:
        follower.join(300)

    log = sl.read(path)
    end = [n for batch in log._reader.batches() for n in batch.number.tolist()]
    assert [] == errors
    assert acknowledged in end
    assert list(range(len(end))) == end
    assert [end] * 3 == seen
    assert [[commit.hash for commit in log.commits()]] * 3 == hashes


def test_waiting_costs_next_to_nothing(rolled: Path) -> None:
    """A follower of a log in which nothing happens looks at the folder, and reads no file."""
    looks = iter(range(200))
    log = sl.read(rolled)

    calls = calls_of(lambda: list(log.follow(15, poll_s=0, stop=lambda: next(looks) == 199)))

    assert None is next(looks, None)
    assert 6 * len(log._reader.segments) >= calls["open"]  # at the first look, none later
    assert calls.total() < 200 * MOST_CALLS_A_LOOK
