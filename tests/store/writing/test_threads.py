"""Several threads write and sync one log: every byte in its order, whatever the switches."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import RecordedEvent
from semmap_log.core.model.events import DoorAnnotated
from semmap_log.errors import LogPoisonedError
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.writing import segment_chain
from semmap_log.store.writing.durability import BatchTimer

LEVELS = ("event", "batch", "flush", "none")
SHORT, LONG = "x" * 10, "y" * 60_000


@pytest.fixture(autouse=True)
def _quick_switches() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def together(work: list[Callable[[], None]]) -> None:
    """Run all in threads of their own; raise what one of them raised."""
    failed: list[BaseException] = []

    def run(one: Callable[[], None]) -> None:
        try:
            one()
        except BaseException as error:  # noqa: BLE001 - handed on
            failed.append(error)

    threads = [threading.Thread(target=run, args=(one,)) for one in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failed:
        raise failed[0]


@pytest.mark.parametrize("level", LEVELS)
def test_eight_threads_lose_nothing(
    tmp_path: Path, level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wait at every third, a reader in the same process, rolls in between."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 50)
    path, rounds = tmp_path / "log", 24
    with sl.create(path, tz="UTC", durability=level) as log:
        door = log.add_door()

        def write(name: int) -> None:
            for i in range(rounds):
                text = LONG if (i + name) % 4 == 0 else SHORT
                appended = log.annotate(door, f"{name}", f"{i} {text}")
                if i % 3 == 0:
                    appended.wait()

        def read() -> None:
            for _ in range(10):
                sl.read(path).replay()
                log.replay()

        together([*[lambda name=name: write(name) for name in range(8)], read])

    assert 0 == verify(path).exit_code
    texts = [(e.key, e.value) for b in sl.read(path).batches() for e in map(_event, b) if e]
    wrote = [
        (f"{name}", f"{i} {LONG if (i + name) % 4 == 0 else SHORT}")
        for name in range(8)
        for i in range(rounds)
    ]
    assert sorted(wrote) == sorted(texts)
    for name in range(8):
        mine = [text for key, text in texts if key == f"{name}"]
        assert [text for key, text in wrote if key == f"{name}"] == mine


def _event(recorded: RecordedEvent) -> DoorAnnotated | None:
    return recorded.event if isinstance(recorded.event, DoorAnnotated) else None


def test_a_sync_waits_for_who_is_writing_what_was_held_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One thread is writing another's event: it is not durable yet."""
    log = sl.create(tmp_path / "log", tz="UTC", durability="none")
    door = log.add_door()
    log.sync()
    appended = log.annotate(door, "first", SHORT)
    in_write, proceed, calls = threading.Event(), threading.Event(), []
    write, sync = os.write, os.fdatasync

    def slow_write(fd: int, data: bytes) -> int:
        if SHORT.encode() in data and not in_write.is_set():
            in_write.set()
            assert proceed.wait(100)
        calls.append("write")
        return write(fd, data)

    def seen_sync(fd: int) -> None:
        calls.append("sync")
        sync(fd)

    monkeypatch.setattr(os, "write", slow_write)
    monkeypatch.setattr(os, "fdatasync", seen_sync)
    more = lambda: [log.annotate(door, f"more {i}", LONG) for i in range(2)]  # noqa: E731
    writing = threading.Thread(target=more)
    writing.start()
    assert in_write.wait(100)
    waiting = threading.Thread(target=appended.wait)
    waiting.start()
    waiting.join(0.05)
    is_waiting, called = waiting.is_alive(), list(calls)
    proceed.set()
    for thread in (writing, waiting):
        thread.join(100)
    log.close()

    assert (True, []) == (is_waiting, called)
    assert "write" == calls[0]
    assert 0 == verify(tmp_path / "log").exit_code


def test_nothing_is_written_behind_a_write_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was held back is gone: a later chunk would lie behind a gap."""
    log = sl.create(tmp_path / "log", tz="UTC", durability="none")
    door = log.add_door()
    log.sync()
    log.annotate(door, "lost", SHORT)
    write = os.write

    def refuse(fd: int, data: bytes) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "write", refuse)
    with pytest.raises(KeyboardInterrupt):
        log.replay(event=0)  # hands on what is held back
    monkeypatch.setattr(os, "write", write)

    with pytest.raises(LogPoisonedError):
        log.annotate(door, "behind", LONG)
    log.close()

    assert 1 == sum(len(batch) for batch in sl.read(tmp_path / "log").batches())


def test_threads_that_append_at_once_share_one_timer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two who start it together get one thread, and `close` ends it."""
    looking, both, synced = threading.Barrier(2), threading.Barrier(2), threading.Event()
    timer = BatchTimer(synced.set, 0.001)
    is_set, made = threading.Event.is_set, threading.Thread.__init__

    def unset_for_both(event: threading.Event) -> bool:
        found = is_set(event)
        if event is timer._appended and not found:
            looking.wait(100)
        return found

    def met(thread: threading.Thread, *args: Any, **more: Any) -> None:
        if more.get("name") == "semmap-log sync":
            with suppress(threading.BrokenBarrierError):
                both.wait(1)  # in vain, if nobody else makes one
        made(thread, *args, **more)

    monkeypatch.setattr(threading.Thread, "__init__", met)
    monkeypatch.setattr(timer._appended, "is_set", lambda: unset_for_both(timer._appended))
    together([timer.start, timer.start])
    monkeypatch.undo()
    assert synced.wait(100)

    timers = [t for t in threading.enumerate() if t.name == "semmap-log sync"]
    timer.close()

    assert 1 == len(timers)
    assert not timers[0].is_alive()
