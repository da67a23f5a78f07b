"""Logs in an S3 bucket, read where they lie: the answers are those from the disk, or an error."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.model.events import DoorObserved
from semmap_log.errors import LogAccessError, LogError, NotALogError
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.removed_source import ObjectSegments
from tests.bucket import NAME, put_folder, served_bucket
from tests.web_server import web_server

RECORDINGS = Path(__file__).parents[3] / "recordings"


@pytest.fixture(scope="module")
def environment() -> Iterator[dict[str, str]]:
    with served_bucket() as named:
        yield named


@pytest.fixture
def bucket(environment: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> str:
    """
    An URL in a bucket that the environment names.
    """
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    return f"s3://{NAME}"


def same_answers(url: str, folder: Path) -> None:
    there, here = sl.read(url), sl.read(folder)
    for at in (None, "2026-03-02T10:30"):
        told = [repr(log.replay(at).doors) for log in (here, there)]
        assert told[0] == told[1]
    assert all_events(here) == all_events(there)


def all_events(log: sl.DoorLog) -> list[str]:
    return [repr(event) for batch in log.batches_in() for event in batch]


@pytest.mark.parametrize("name", ["office", "clinic_week"])
def test_a_log_in_a_bucket_answers_as_one_on_the_disk(bucket: str, name: str) -> None:
    url = f"{bucket}/logs/{name}"
    put_folder(RECORDINGS / name, url)

    same_answers(url, RECORDINGS / name)


def test_a_log_in_a_bucket_is_verified(bucket: str) -> None:
    put_folder(RECORDINGS / "office", f"{bucket}/verified")

    found = verify(UrlPath(f"{bucket}/verified"))

    assert (0, verify(RECORDINGS / "office").head) == (found.exit_code, found.head)


def test_a_flipped_byte_in_a_bucket_is_damage(bucket: str, tmp_path: Path) -> None:
    """Neither `verify` nor a question passes over it."""
    log = shutil.copytree(RECORDINGS / "office", tmp_path / "log")
    segment = log / "office_000000.mcap"
    data = bytearray(segment.read_bytes())
    data[len(data) // 2] ^= 1
    segment.write_bytes(data)
    put_folder(log, f"{bucket}/flipped")

    assert 4 == verify(UrlPath(f"{bucket}/flipped")).exit_code
    with pytest.raises(LogError):
        list(sl.read(f"{bucket}/flipped").batches_in())


def test_a_log_that_grows_in_a_bucket_is_followed(bucket: str, tmp_path: Path) -> None:
    """Each copy of it that is put there is a longer log."""
    url = f"{bucket}/grows"
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9)
        put_folder(tmp_path / "log", url)
        reader = LogReader(ObjectSegments(ObjectStore(UrlPath(url)), listed_for_s=0.0))
        before = reader.last_event()
        log.observe(door, "open")
        put_folder(tmp_path / "log", url)
        reader.refresh()

    assert before + 1 == reader.last_event()


def test_an_object_that_is_exchanged_under_a_reader_is_told(bucket: str, tmp_path: Path) -> None:
    url = f"{bucket}/exchanged"
    put_folder(RECORDINGS / "office", url)
    store = ObjectStore(UrlPath(url))
    source = ObjectSegments(store).open("office_000000.mcap")
    longer = tmp_path / "office_000000.mcap"
    longer.write_bytes((RECORDINGS / "office" / longer.name).read_bytes() + b"\0")
    put_folder(tmp_path, url)

    with pytest.raises(LogAccessError, match="the object was replaced"):
        source.read(0, 100)


def test_a_log_on_a_plain_web_server_answers_by_what_its_metadata_names() -> None:
    """Such a server lists nothing, and this one knows no ranges either."""
    with web_server(RECORDINGS / "office") as url:
        same_answers(url, RECORDINGS / "office")
        assert 0 == verify(UrlPath(url)).exit_code


def test_nothing_there_is_no_log(bucket: str) -> None:
    with pytest.raises(NotALogError, match="got nothing"):
        sl.read(f"{bucket}/nothing")


def test_a_password_in_a_url_is_refused_and_not_repeated() -> None:
    with pytest.raises(NotALogError) as caught:
        sl.read("s3://me:secret@bucket/log")

    assert "secret" not in str(caught.value)


def test_a_store_that_cannot_be_reached_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "a")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "b")
    store = ObjectStore(UrlPath("s3://bucket/log"), patience_s=0.5)

    with pytest.raises(LogAccessError, match=r"s3://bucket/log/manifest.json"):
        LogReader(ObjectSegments(store))


@pytest.mark.parametrize("make", [sl.append, sl.create])
def test_a_log_in_a_store_is_not_written(make: object, tmp_path: Path) -> None:
    with pytest.raises(LogAccessError, match="can only be read"):
        make("s3://bucket/log")  # type: ignore[operator]


def test_a_moment_of_a_long_segment_costs_few_of_its_bytes(bucket: str, tmp_path: Path) -> None:
    """Measured in bytes that the store sent, not in seconds."""
    with sl.create(tmp_path / "log", tz="UTC", durability="none", compact=False) as log:
        door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9)
        for _ in range(40):
            states = np.arange(10_000) % 2 + 1
            ids = np.full(10_000, door)
            log.append(EventBatch.of(DoorObserved, door_id=ids, state=states.astype(np.uint8)))
    put_folder(tmp_path / "log", f"{bucket}/long")
    store = CountingStore(UrlPath(f"{bucket}/long"))

    LogReader(ObjectSegments(store)).event(200_000)

    size = sum(file.stat().st_size for file in (tmp_path / "log").glob("*.mcap"))
    assert store.sent < 0.05 * size


class CountingStore(ObjectStore):
    """Counts the bytes that are sent."""

    def __init__(self, url: UrlPath) -> None:
        super().__init__(url)
        self.sent = 0

    def part(self, status, start, end):  # type: ignore[no-untyped-def]
        self.sent += end - start
        return super().part(status, start, end)
