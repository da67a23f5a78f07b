"""Shipping beside a writer: segments as they close, and a writer that never notices."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError
from semmap_log.fleet.background_shipper import BackgroundShipper, ShippingIntervals
from semmap_log.fleet.shipping import ship
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.removed_source import ObjectSegments
from semmap_log.store.writing import segment_chain
from tests.fleet.lying_store import Answer, lying_store
from tests.fleet.test_shipping import events_of
from tests.live.ros.running import DEADLINE_S

SOON = ShippingIntervals(look_s=0.02, settle_s=0.0, first_retry_s=0.02, longest_retry_s=0.05)
LINE = '{"kind": "DoorObserved", "door": "front", "state": "OPEN"}\n'


@pytest.fixture
def office(tmp_path: Path) -> Path:
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(name="front")
    return tmp_path / "office"


@pytest.fixture
def _rolls_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 50)
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)


def until(is_so: Callable[[], bool]) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def observe(log: sl.DoorLogWriter, count: int) -> None:
    for number in range(count):
        log.observe("front", "open" if number % 2 else "closed")


class SwitchedStore(ObjectStore):
    """A store that can be away, or stand still."""

    def __init__(self, url: UrlPath) -> None:
        self.error: Exception | None = None
        self.answers = threading.Event()
        self.answers.set()
        self.is_requested = threading.Event()
        super().__init__(url)

    def _asked(self, name, request):  # type: ignore[no-untyped-def]
        self.is_requested.set()
        self.answers.wait()
        if self.error is not None:
            raise self.error
        return super()._asked(name, request)


@pytest.mark.usefixtures("_rolls_often")
def test_segments_are_sent_as_they_close_and_the_last_at_the_end(bucket: str, office: Path) -> None:
    with (
        BackgroundShipper(office, bucket, pauses=SOON) as beside,
        sl.append(office, durability="none") as log,
    ):
        observe(log, 120)
        until(lambda: beside.status.is_all_sent and beside.status.sent >= 3)
        shipped = beside.status.shipped
        assert shipped is not None
        there = sl.read(bucket).last_event()
        assert 100 <= there < log.last_event()
        observe(log, 30)

    assert beside.status.is_all_sent
    assert events_of(office) == events_of(bucket)


def test_a_segment_is_sent_once_it_has_settled(bucket: str, office: Path) -> None:
    """What the writer before has left is sent at once; the next waits, to be compacted first."""
    with BackgroundShipper(
        office, bucket, pauses=ShippingIntervals(look_s=0.02, settle_s=3600.0)
    ) as beside:
        until(lambda: beside.status.is_all_sent)
        first = beside.status.sent
        with sl.append(office) as log:
            observe(log, 1)
        until(lambda: not beside.status.is_all_sent)
        assert beside.status.sent == first == 1

    assert (2, True) == (beside.status.sent, beside.status.is_all_sent)
    assert events_of(office) == events_of(bucket)


@pytest.mark.usefixtures("_rolls_often")
@pytest.mark.parametrize(
    "error", [LogAccessError("the cable was cut."), RuntimeError("odd"), MemoryError()]
)
def test_a_store_that_is_away_is_told_once_and_told_when_it_is_back(
    bucket: str, office: Path, error: Exception
) -> None:
    store, said = SwitchedStore(UrlPath(bucket)), list[str]()
    store.error = error
    with (
        BackgroundShipper(office, store, tell=said.append, pauses=SOON) as beside,
        sl.append(office, durability="none") as log,
    ):
        observe(log, 60)
        until(lambda: bool(beside.status.problem))
        observe(log, 60)
        assert (1, True) == (len(said), "Recording continues" in said[0])
        assert command_line("ship", office, UrlPath(bucket)) in said[0]
        store.error = None
        until(lambda: beside.status.is_all_sent)
        assert (2, True, "") == (len(said), "works again" in said[1], beside.status.problem)

    assert events_of(office) == events_of(bucket)
    assert len(said) == 2


@pytest.mark.usefixtures("_rolls_often")
def test_no_append_waits_for_a_store_that_stands_still(bucket: str, office: Path) -> None:
    """
    While one request hangs, ten thousand appends, two hundred closed segments and the close of the
    writer go through; and the end gives up, and says that not all is sent.
    """
    store = SwitchedStore(UrlPath(bucket))
    store.answers.clear()
    try:
        with BackgroundShipper(office, store, pauses=SOON, end_s=0.1) as beside:
            until(store.is_requested.is_set)
            with sl.append(office, durability="none", compact=False) as log:
                observe(log, 10_000)
        assert (0, False) == (beside.status.sent, beside.status.is_all_sent)
    finally:
        store.answers.set()

    ship(office, UrlPath(bucket))

    assert len(events_of(bucket)) >= 10_000
    assert events_of(office) == events_of(bucket)


def test_once_given_up_nothing_more_is_sent(bucket: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    sl.create(log, tz="UTC").close()
    store = SwitchedStore(UrlPath(bucket))
    store.answers.clear()
    beside = BackgroundShipper(log, store, pauses=SOON)
    beside.start()
    until(store.is_requested.is_set)

    beside.close(end_s=0.0)
    store.answers.set()
    until(lambda: not any(one.name == "semmap_log shipping" for one in threading.enumerate()))

    assert "manifest.json" not in [one.name for one in ObjectStore(UrlPath(bucket)).list()]


def _zeros(_: int, answer: Answer) -> Answer:
    status, body, said = answer
    return status, bytes(len(body)), said


def test_a_store_that_lies_is_named_and_nothing_is_disturbed(
    bucket: str, office: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(office, UrlPath(bucket))
    got = ObjectStore(UrlPath(bucket)).whole("manifest.json", most_bytes=2**24)
    assert got is not None
    objects = tmp_path / "objects"
    objects.mkdir()
    (objects / "manifest.json").write_bytes(got[0])
    said = list[str]()
    with lying_store(objects, _zeros) as environment:
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        store = ObjectStore(UrlPath("s3://bucket/log"), patience_s=1.0)
        with BackgroundShipper(office, store, tell=said.append, pauses=SOON) as beside:
            until(lambda: bool(said))
            with sl.append(office) as log:
                observe(log, 3)
    assert ("no manifest as it was written" in beside.status.problem, len(said)) == (True, 1)
    assert len(events_of(office)) == 5


def test_a_fork_is_refused_and_recording_goes_on(bucket: str, office: Path, tmp_path: Path) -> None:
    other = shutil.copytree(office, tmp_path / "other")
    with sl.append(other) as log:
        observe(log, 2)
    ship(other, UrlPath(bucket))
    said = list[str]()

    with (
        BackgroundShipper(office, bucket, tell=said.append, pauses=SOON) as beside,
        sl.append(office) as log,
    ):
        observe(log, 1)
    assert "refused, and nothing there is changed" in beside.status.problem
    assert len(said) == 1
    assert events_of(other) == events_of(bucket)


def _record(office: Path, url: str, lines: int) -> subprocess.Popen[str]:
    recorder = subprocess.Popen(
        [sys.executable, "-m", "semmap_log", "record", office, "--ack", "--ship", url],
        text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert recorder.stdin is not None
    assert recorder.stdout is not None
    recorder.stdin.write(LINE * lines)
    recorder.stdin.flush()
    for _ in range(lines):
        assert '"event"' in recorder.stdout.readline()
    return recorder


def test_record_ships_at_its_end_and_what_a_killed_one_left(bucket: str, office: Path) -> None:
    killed = _record(office, bucket, 20)
    killed.kill()
    killed.communicate(timeout=DEADLINE_S)

    asked = _record(office, bucket, 5)
    asked.send_signal(signal.SIGTERM)
    _, said = asked.communicate(timeout=DEADLINE_S)

    assert (0, True) == (asked.returncode, f"{bucket}: shipped up to event 26." in said)
    assert events_of(office) == events_of(bucket)
    assert LogReader(ObjectSegments(ObjectStore(UrlPath(bucket)))).last_event() == 26
