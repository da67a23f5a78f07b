"""Small segments in a store: the next ones are asked for while one is read."""

from __future__ import annotations

import threading
import time
from collections import Counter
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.object_source import _kept
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import LogAccessError
from semmap_log.fleet.shipping import ship
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.reading.window import Window
from tests.fleet.test_shipping import events_of

DAYS = 24
ROUND_TRIP_S = 0.05


class SlowStore:
    """Each range takes a while to come; tells which were asked for, and how many at once."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked: Counter[str] = Counter()
        self.most_at_once = 0
        self._now = 0
        self._lock = threading.Lock()
        real = ObjectStore.part

        def part(store: ObjectStore, status: ObjectStatus, start: int, end: int) -> bytes:
            with self._lock:
                self.asked[status.name] += 1
                self._now += 1
                self.most_at_once = max(self.most_at_once, self._now)
            try:
                time.sleep(ROUND_TRIP_S)
                return real(store, status, start, end)
            finally:
                with self._lock:
                    self._now -= 1

        monkeypatch.setattr(ObjectStore, "part", part)


@pytest.fixture
def days(bucket: str, tmp_path: Path) -> tuple[Path, str]:
    """A log of a small segment a day, on a disk and in a store."""
    log = tmp_path / "days"
    sl.create(log, tz="UTC", compact=False).close()
    for number in range(DAYS):
        with sl.append(log, compact=False) as writer:
            door = writer.add_door(name=f"door {number}")
            for _ in range(300):
                writer.observe(door, "open" if number % 2 else "closed", reason="x" * 3800)
    ship(log, UrlPath(bucket))
    _kept.clear()
    return log, bucket


def test_a_whole_log_comes_in_a_few_round_trips(
    days: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Several segments are on their way at once, all behind the first are asked for once."""
    log, url = days
    expected = events_of(log)
    store = SlowStore(monkeypatch)

    found = events_of(url)

    assert expected == found
    assert DAYS == len(store.asked)
    assert DAYS - 1 == list(store.asked.values()).count(1)
    assert 4 <= store.most_at_once


def test_a_question_that_ends_early_asks_for_little(
    days: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who takes the first events and leaves has not paid for the log."""
    _, url = days
    store = SlowStore(monkeypatch)

    first = next(iter(sl.read(url).batches_in()))

    assert 0 == first.number[0]
    assert 3 >= len(store.asked)


def test_what_a_window_does_not_reach_is_not_asked_for(
    days: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ahead is asked only for what the manifest says may be read."""
    _, url = days
    store = SlowStore(monkeypatch)
    window = Window(first_event=301 * 4, before_event=301 * 6)

    found = sum(len(batch) for batch in sl.read(url).batches_in(window))

    assert 602 == found
    assert 3 >= len(store.asked)


def test_an_object_that_goes_meanwhile_is_named(
    days: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was asked for ahead and failed is an error where it is read, not before, not never."""
    _, url = days
    log = sl.read(url)
    names = sorted(status.name for status in ObjectStore(UrlPath(url)).list())
    ObjectStore(UrlPath(url)).remove(names[7])

    seen: list[int] = []
    with pytest.raises(LogAccessError, match=names[7]):
        seen.extend(map(len, log.batches_in()))

    assert 302 * 7 == sum(seen)
    assert verify(UrlPath(url)).exit_code
