"""A log in a store that is followed while somebody else ships: no gap, no repeat, no rollback."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.fleet.shipping import ship
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.byte_layout import MANIFEST_NAME
from semmap_log.store.compaction import compact
from semmap_log.store.reading.following import FollowedCommit
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.removed_source import ObjectSegments
from tests.fleet.test_shipping import RECORDINGS, a_log
from tests.live.ros.running import DEADLINE_S


class WatchedStore(ObjectStore):
    """Keeps what was asked for, and whether it came."""

    def __init__(self, url: UrlPath) -> None:
        super().__init__(url)
        self.wholes: list[bool] = []
        self.parts = 0

    def whole(
        self, name: str, unlike: str = "", *, most_bytes: int
    ) -> tuple[bytes, ObjectStatus] | None:
        found = super().whole(name, unlike, most_bytes=most_bytes)
        self.wholes.append(found is not None)
        return found

    def part(self, status: ObjectStatus, start: int, end: int) -> bytes:
        self.parts += 1
        return super().part(status, start, end)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A small log, whose closed segment the next writer continues in a copy."""
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        log.add_door(name="front")
    return tmp_path / "log"


def observe(log: Path, count: int) -> None:
    with sl.append(log, compact=False) as opened:
        for number in range(count):
            opened.observe("front", "open" if number % 2 else "closed")


def opened(store: ObjectStore) -> sl.DoorLog:
    return sl.DoorLog(LogReader(ObjectSegments(store, listed_for_s=0.0)))


def numbers(commits: Iterator[FollowedCommit], count: int) -> list[int]:
    found: list[int] = []
    while len(found) < count:
        found += [recorded.number for recorded in next(commits)]
    return found


def put_manifest(url: str, data: bytes) -> None:
    store = ObjectStore(UrlPath(url))
    now = store.whole(MANIFEST_NAME, most_bytes=2**24)
    assert now is not None
    assert store.replace(MANIFEST_NAME, data, now[1].e_tag)


def manifest(url: str) -> bytes:
    found = ObjectStore(UrlPath(url)).whole(MANIFEST_NAME, most_bytes=2**24)
    assert found is not None
    return found[0]


def test_a_continued_segment_goes_on_at_the_right_event(bucket: str, log: Path) -> None:
    """The same number, longer, under another name: twice, and then one more behind it."""
    ship(log, UrlPath(bucket))
    commits = opened(ObjectStore(UrlPath(bucket))).follow(-1, poll_s=0.01)
    assert numbers(commits, 2) == [0, 1]

    for first in (2, 5, 8):
        observe(log, 3)
        done = ship(log, UrlPath(bucket))

        assert len(done.manifest.segments) == 1
        assert numbers(commits, 3) == [first, first + 1, first + 2]


def test_segments_that_came_meanwhile_are_seen(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log", 1)
    ship(log, UrlPath(bucket))
    commits = opened(ObjectStore(UrlPath(bucket))).follow(poll_s=0.01)
    end = sl.read(log).last_event()
    with sl.append(log, compact=False) as writer:
        for _ in range(400):
            writer.observe("front", "open", reason="x" * 3000)
    observe(log, 2)

    done = ship(log, UrlPath(bucket))

    assert len(done.manifest.segments) > 1
    assert numbers(commits, 402) == list(range(end + 1, end + 403))


def test_a_compacted_log_goes_on_at_the_right_event(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log", 2)
    ship(log, UrlPath(bucket))
    reading = opened(ObjectStore(UrlPath(bucket)))
    end = sl.read(log).last_event()
    commits = reading.follow(end - 3, poll_s=0.01)
    assert numbers(commits, 1) == [end - 2]

    compact(log)
    assert ship(log, UrlPath(bucket)).sent > 0
    observe(log, 2)
    ship(log, UrlPath(bucket))

    assert numbers(commits, 4) == [end - 1, end, end + 1, end + 2]


def test_a_manifest_that_is_the_same_is_not_sent_and_nothing_else_is_asked(
    bucket: str, log: Path
) -> None:
    ship(log, UrlPath(bucket))
    store = WatchedStore(UrlPath(bucket))
    looks = iter(range(6))
    commits = opened(store).follow(poll_s=0.0, stop=lambda: next(looks) == 5)
    store.wholes.clear()
    store.parts = 0

    assert list(commits) == []
    assert len(store.wholes) >= 6
    assert (sum(store.wholes), store.parts) == (0, 0)


def test_looked_at_more_often_it_is_asked_once_a_second(bucket: str, log: Path) -> None:
    ship(log, UrlPath(bucket))
    store = WatchedStore(UrlPath(bucket))
    reading = sl.DoorLog(LogReader(ObjectSegments(store, listed_for_s=3600.0)))
    looks = iter(range(100))

    assert list(reading.follow(poll_s=0.0, stop=lambda: next(looks) == 99)) == []
    assert len(store.wholes) == 1


def test_a_log_that_was_rolled_back_is_an_error(bucket: str, log: Path) -> None:
    """Nothing is told twice, and nothing of the older state is taken for the log's end."""
    ship(log, UrlPath(bucket))
    before = manifest(bucket)
    observe(log, 3)
    ship(log, UrlPath(bucket))
    reading = opened(ObjectStore(UrlPath(bucket)))
    commits = reading.follow(-1, poll_s=0.01)
    assert numbers(commits, 5) == [0, 1, 2, 3, 4]

    put_manifest(bucket, before)

    with pytest.raises(CorruptLogError, match="was restored or replaced"):
        next(commits)
    with pytest.raises(CorruptLogError, match="was restored or replaced"):
        reading.refresh()


def test_a_log_with_other_commits_is_an_error(bucket: str, log: Path, tmp_path: Path) -> None:
    other = shutil.copytree(log, tmp_path / "other")
    observe(log, 3)
    ship(log, UrlPath(bucket))
    commits = opened(ObjectStore(UrlPath(bucket))).follow(-1, poll_s=0.01)
    assert len(numbers(commits, 5)) == 5
    observe(other, 4)
    ship(other, UrlPath(f"{bucket}/other"))
    there = ObjectStore(UrlPath(f"{bucket}/other"))
    for one in there.list():
        got = there.whole(one.name, most_bytes=2**24)
        assert got is not None
        if one.name.endswith(".mcap"):
            ObjectStore(UrlPath(bucket)).create(one.name, got[0])

    put_manifest(bucket, manifest(f"{bucket}/other"))

    with pytest.raises(CorruptLogError, match="was restored or replaced"):
        next(commits)


def test_another_log_in_its_place_is_an_error(bucket: str, log: Path) -> None:
    ship(log, UrlPath(bucket))
    commits = opened(ObjectStore(UrlPath(bucket))).follow(-1, poll_s=0.01)
    assert len(numbers(commits, 2)) == 2
    ship(RECORDINGS / "office", UrlPath(f"{bucket}/other"))

    put_manifest(bucket, manifest(f"{bucket}/other"))

    with pytest.raises(LogError, match="the log was replaced by another one"):
        next(commits)


def test_a_log_without_its_manifest_is_an_error(bucket: str, log: Path) -> None:
    """The objects of older states lie there, too: nobody may guess which of them are the log."""
    ship(log, UrlPath(bucket))
    observe(log, 3)
    ship(log, UrlPath(bucket))
    reading = opened(ObjectStore(UrlPath(bucket)))
    commits = reading.follow(-1, poll_s=0.01)
    assert len(numbers(commits, 5)) == 5

    ObjectStore(UrlPath(bucket)).remove(MANIFEST_NAME)

    with pytest.raises(CorruptLogError, match="is there twice"):
        next(commits)


def test_a_head_kept_elsewhere_shows_that_a_log_was_rolled_back(
    bucket: str, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The older state is whole by itself: without the head nobody could tell."""
    ship(log, UrlPath(bucket))
    before = manifest(bucket)
    observe(log, 3)
    head = ship(log, UrlPath(bucket)).manifest.segments[-1].head
    assert verify(UrlPath(bucket), head).exit_code == 0

    put_manifest(bucket, before)

    assert verify(UrlPath(bucket)).exit_code == 0
    with pytest.raises(SystemExit, match=r"^4$"):
        main(["verify", bucket, "--head", head.hex()])
    assert "head" in capsys.readouterr().out


def test_tail_follows_a_url(bucket: str, log: Path) -> None:
    ship(log, UrlPath(bucket))
    tail = subprocess.Popen(
        [sys.executable, "-m", "semmap_log", "tail", "-f", "--json", bucket],
        text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        assert tail.stdout is not None
        assert [json.loads(tail.stdout.readline())["event"] for _ in range(2)] == [0, 1]
        observe(log, 2)
        ship(log, UrlPath(bucket))
        assert [json.loads(tail.stdout.readline())["event"] for _ in range(2)] == [2, 3]
    finally:
        tail.terminate()
        tail.communicate(timeout=DEADLINE_S)
