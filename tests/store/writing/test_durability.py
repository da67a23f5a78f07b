"""What each level of durability promises, how threads share syncs, and what a failed one means."""

from __future__ import annotations

import asyncio
import gc
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.commits import Durability
from semmap_log.core.model.events import DoorObserved, PatrolStarted, RobotPose
from semmap_log.errors import InvalidEventError, LogPoisonedError
from semmap_log.log.door_log import appender
from semmap_log.store.writing import segment_chain
from semmap_log.store.writing.durability import BatchTimer

LEVELS = ["event", "batch", "flush", "none"]


def _events(path: Path) -> int:
    return sum(len(batch) for batch in sl.read(path).batches())


def _break_syncs(log: sl.DoorLogWriter) -> None:
    """Make the kernel itself refuse to sync: /dev/null takes what is written, but no fdatasync."""
    _put_under(log, "/dev/null")


def _fill_the_disk(log: sl.DoorLogWriter) -> None:
    _put_under(log, "/dev/full")


def _put_under(log: sl.DoorLogWriter, device: str) -> None:
    live = log._writer._chain.live
    assert live is not None
    fd = os.open(device, os.O_WRONLY)
    os.dup2(fd, live._fd)
    os.close(fd)


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_stores_the_same_once_it_is_closed(level: str, tmp_path: Path) -> None:
    """They differ in what is true before; each commit says which promise it was made under."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", durability=level) as log:
        door = log.add_door()
        for _ in range(200):
            log.observe(door, "open")
    with sl.append(path, durability=level) as log:
        log.observe(door, "closed")

    assert 202 == _events(path)
    assert {Durability.parse(level)} == {c.durability for c in sl.read(path).commits()}
    assert sl.read(path)._reader.segments[-1].closed


def test_event_is_durable_when_append_returns(tmp_path: Path) -> None:
    """And each commit says that all before it was."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door()
        for n in range(5):
            log.observe(door, "open")

            assert n + 2 == log.durable_before

    assert [(c.first_event, c.first_event) for c in sl.read(tmp_path / "log").commits()] == [
        (c.first_event, c.durable_before) for c in sl.read(tmp_path / "log").commits()
    ]


def test_poses_that_nothing_follows_are_durable_soon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody waits for them."""
    monkeypatch.setattr(appender, "POSES_WAIT_S", 0.01)
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.robot_pose(RobotPose(x=1.0, y=2.0, theta=0.0))
        deadline = time.monotonic() + 100
        while not log.durable_before and time.monotonic() < deadline:
            time.sleep(0.01)
        assert 1 == log.durable_before


def test_batch_is_durable_after_a_while_without_anybody_asking(tmp_path: Path) -> None:
    """The timer syncs what was appended, once for all of it."""
    with sl.create(tmp_path / "log", tz="UTC", durability="batch", batch_s=0.2) as log:
        begin = time.monotonic()
        door = log.add_door()  # from here on it counts
        last = log.observe(door, "open").commit.last_event
        durable_before, took_s = log.durable_before, time.monotonic() - begin

        assert durable_before <= last or took_s > 0.2
        deadline = time.monotonic() + 100
        while log.durable_before <= last and time.monotonic() < deadline:
            time.sleep(0.01)
        assert last + 1 == log.durable_before


def test_batch_lets_only_so_many_events_wait(tmp_path: Path) -> None:
    """The append that fills the batch syncs it."""
    with sl.create(
        tmp_path / "log", tz="UTC", durability="batch", batch_events=10, batch_s=3000
    ) as log:
        door = log.add_door()
        waiting = []
        for _ in range(50):
            last = log.observe(door, "open").commit.last_event
            waiting.append(last + 1 - log.durable_before)

    assert 9 == max(waiting)
    assert 5 == waiting.count(0)


@pytest.mark.parametrize("level", LEVELS)
def test_an_append_can_be_waited_for(level: str, tmp_path: Path) -> None:
    """By a thread or by a coroutine, whatever the level."""

    async def awaited(log: sl.DoorLogWriter) -> int:
        return (
            await log.append([DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)])
        ).commit.last_event

    with sl.create(tmp_path / "log", tz="UTC", durability=level, batch_s=3000) as log:
        log.add_door()
        first = log.append([DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)])
        first.wait()
        assert first.commit.last_event + 1 == log.durable_before

        last = asyncio.run(awaited(log))
        assert last + 1 == log.durable_before


@pytest.mark.slow
def test_what_is_flushed_outlives_the_process(tmp_path: Path) -> None:
    """Killed right after append returned, without a sync: every commit is there."""
    path = tmp_path / "log"
    code = (
        "import os, sys, semmap_log as sl\n"
        "log = sl.create(sys.argv[1], tz='UTC', durability='flush')\n"
        "door = log.add_door()\n"
        "for _ in range(20): log.observe(door, 'open')\n"
        "os.kill(os.getpid(), 9)\n"
    )

    subprocess.run([sys.executable, "-c", code, path], check=False)

    assert 21 == _events(path)
    sl.append(path).close()
    assert 21 == _events(path)


def test_none_waits_in_memory(tmp_path: Path) -> None:
    """Others see it once it is synced; the log itself at once."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", durability="none") as log:
        door = log.add_door()
        assert 0 == _events(path)

        log.sync()
        assert 1 == _events(path)

        log.observe(door, "open")
        assert 1 == _events(path)
        assert sl.DoorState.OPEN == log.replay()[door].state


def test_none_writes_when_much_waits(tmp_path: Path) -> None:
    """Memory stays small, and readers see whole commits."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", durability="none") as log:
        for n in range(400):
            log.append([PatrolStarted(patrol=n)])

        assert 200 < _events(path) < 400


def test_commits_say_what_was_durable_before_them(tmp_path: Path) -> None:
    """Nothing below that number can be the work of a power cut."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", durability="flush") as log:
        door = log.add_door()
        log.observe(door, "open")
        log.sync()
        log.observe(door, "closed")
        log.observe(door, "open")

    assert [0, 0, 2, 2] == [c.durable_before for c in sl.read(path).commits()]


def test_one_sync_serves_all_who_wait(tmp_path: Path) -> None:
    """What was written while another sync was under way is synced by the next one, all of it."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door()
        live = log._writer._chain.live
        assert live is not None
        syncs = []
        first_is_in, proceed, real = threading.Event(), threading.Event(), live.sync

        def slow() -> None:
            syncs.append(log._writer.next_event)
            first_is_in.set()
            proceed.wait(100)
            real()

        live.sync = slow  # type: ignore[method-assign]  # the real sync, only later
        threads = [threading.Thread(target=log.observe, args=(door, "open")) for _ in range(9)]
        threads[0].start()
        first_is_in.wait(100)
        for thread in threads[1:]:
            thread.start()
        while log._writer.next_event < 10:
            time.sleep(0.001)
        proceed.set()
        for thread in threads:
            thread.join(100)

        assert [2, 10] == syncs
        assert 10 == log.durable_before


@pytest.mark.parametrize("breakage", [_break_syncs, _fill_the_disk])
def test_the_first_failure_is_the_last_thing_that_happens(breakage, tmp_path: Path) -> None:
    """The caller learns that the outcome is unknown."""
    path = tmp_path / "log"
    log = sl.create(path, tz="UTC")
    door = log.add_door()
    breakage(log)

    with pytest.raises(LogPoisonedError, match="unknown") as failed:
        log.observe(door, "open")
    before = (path / "log_000000.mcap").read_bytes()
    for again in (lambda: log.observe(door, "open"), log.sync, log.add_door):
        with pytest.raises(LogPoisonedError):
            again()
    log.close()
    del log
    gc.collect()

    assert before == (path / "log_000000.mcap").read_bytes()
    with sl.append(path) as log:
        for _ in range(2):
            log.observe(door, "open", command_id=failed.value.command_id)
    assert 2 == _events(path)


def test_a_failed_sync_is_told_to_all_who_wait(tmp_path: Path) -> None:
    """No thread may take an append for durable because another's sync came later."""
    log = sl.create(tmp_path / "log", tz="UTC")
    door = log.add_door()
    _break_syncs(log)
    told = []

    def append() -> None:
        try:
            log.observe(door, "open")
        except LogPoisonedError:
            told.append(True)

    threads = [threading.Thread(target=append) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    log.close()

    assert 8 == len(told)


def test_a_batch_that_cannot_be_synced_is_told_at_the_next_append(tmp_path: Path) -> None:
    """The timer's failure is nobody's to see, but the log takes nothing more."""
    log = sl.create(tmp_path / "log", tz="UTC", durability="batch", batch_s=0.01)
    door = log.add_door()
    log.sync()
    _break_syncs(log)
    appended = log.observe(door, "open")
    deadline = time.monotonic() + 100
    while not log._writer._syncs.is_broken and time.monotonic() < deadline:
        time.sleep(0.01)

    with pytest.raises(LogPoisonedError):
        log.observe(door, "closed")
    with pytest.raises(LogPoisonedError):
        appended.wait()
    log.close()


def test_an_interrupt_in_a_sync_leaves_a_writer_that_refuses(tmp_path: Path) -> None:
    """Whether it was done is not known; a second one might say yes without the data."""
    path = tmp_path / "log"
    log = sl.create(path, tz="UTC")
    door = log.add_door()
    live = log._writer._chain.live
    assert live is not None

    def interrupted() -> None:
        raise KeyboardInterrupt

    live.sync = interrupted  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        log.observe(door, "open")
    with pytest.raises(LogPoisonedError):
        log.observe(door, "closed")
    log.close()

    assert 2 == _events(path)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"durability": "sometimes"}, "one of event, batch, flush, none"),
        ({"batch_events": 0}, "1 or more"),
        ({"batch_s": -1.0}, "seconds"),
        ({"batch_s": float("nan")}, "seconds"),
    ],
)
def test_a_promise_that_means_nothing_is_refused(options, what: str, tmp_path: Path) -> None:
    """Before anything is made."""
    with pytest.raises(InvalidEventError, match=what):
        sl.create(tmp_path / "log", tz="UTC", **options)
    assert not (tmp_path / "log").exists()


def test_a_timer_is_closed_at_any_moment_of_its_round() -> None:
    """Close waits for its thread, but not for ever."""
    timer = BatchTimer(lambda: None, 0.0)
    closing = threading.Thread(target=timer.close, daemon=True)
    clear = timer._appended.clear

    def close_first() -> None:
        closing.start()
        timer._closed.wait()
        while not timer._appended.is_set():
            time.sleep(0.001)
        clear()

    timer._appended.clear = close_first  # type: ignore[method-assign]
    timer.start()
    timer._closed.wait()
    closing.join(100)

    assert not closing.is_alive()


def test_an_interrupt_between_two_segments_leaves_a_writer_that_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One was closed, the next is not there: nothing can be synced, and so nothing is promised."""
    path = tmp_path / "log"
    log = sl.create(path, tz="UTC", durability="flush")
    door = log.add_door()
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 1)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(log._writer._chain, "_report_closed", interrupted)
        with pytest.raises(KeyboardInterrupt):
            log.observe(door, "open")
    with pytest.raises(LogPoisonedError):
        log.sync()
    log.close()

    assert 1 <= _events(path)
