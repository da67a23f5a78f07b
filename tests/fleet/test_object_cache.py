"""Blocks kept on a disk: nothing fetched twice, nothing damaged believed, never too much."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from typer.main import get_command

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.cli.app import app
from semmap_log.core.io.object_cache import VARIABLE, ObjectCache
from semmap_log.core.io.object_source import _kept
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import LogAccessError, LogError
from semmap_log.fleet.shipping import ship
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.removed_source import ObjectSegments
from tests.bucket import put_folder
from tests.fleet.test_following_a_url import WatchedStore
from tests.fleet.test_shipping import RECORDINGS, a_log, events_of


@pytest.fixture
def cache(tmp_path: Path) -> ObjectCache:
    return ObjectCache(tmp_path / "cache")


def fetched(url: str, cache: ObjectCache) -> tuple[int, list[str]]:
    """Return how many ranges are fetched to read all of a log, and its events."""
    _kept.clear()
    store = WatchedStore(UrlPath(url))
    log = sl.DoorLog(LogReader(ObjectSegments(store, cache=cache)))
    events = [repr(event) for batch in log.batches_in() for event in batch]
    return store.parts, events


def files(cache: ObjectCache) -> list[Path]:
    return [path for path in cache.folder.rglob("*") if path.is_file()]


def test_asked_again_nothing_is_fetched(bucket: str, tmp_path: Path, cache: ObjectCache) -> None:
    """Large segments (by blocks) and small ones (whole) alike."""
    log = a_log(tmp_path / "log")
    ship(log, UrlPath(bucket))

    first, second = fetched(bucket, cache), fetched(bucket, cache)

    assert (True, 0) == (first[0] > 0, second[0])
    assert events_of(log) == first[1] == second[1]


def test_a_log_without_a_manifest_is_kept_by_its_tags(bucket: str, cache: ObjectCache) -> None:
    put_folder(RECORDINGS / "office", bucket)

    first, second = fetched(bucket, cache), fetched(bucket, cache)

    assert (True, True) == (first[0] > second[0], first[1] == second[1])
    assert first[1] == events_of(RECORDINGS / "office")


@pytest.mark.parametrize("harm", ["flip", "cut", "empty", "swap", "longer"])
def test_a_damaged_block_is_fetched_again(
    bucket: str, tmp_path: Path, cache: ObjectCache, harm: str
) -> None:
    log = a_log(tmp_path / "log", 2)
    ship(log, UrlPath(bucket))
    first = fetched(bucket, cache)
    kept = sorted(files(cache))
    contents = [path.read_bytes() for path in kept]
    for path, data, other in zip(kept, contents, contents[1:] + contents[:1], strict=True):
        path.write_bytes(
            {
                "flip": data[:100] + bytes([data[100] ^ 1]) + data[101:],
                "cut": data[:-1],
                "empty": b"",
                "swap": other,
                "longer": data + b"\0",
            }[harm]
        )

    again = fetched(bucket, cache)

    assert (first[0], events_of(log)) == again
    assert fetched(bucket, cache)[0] == 0


def test_what_a_store_lies_of_a_small_segment_is_not_kept(bucket: str, cache: ObjectCache) -> None:
    """So that once the store is well again, so is the answer."""
    ship(RECORDINGS / "office", UrlPath(bucket))
    store = ObjectStore(UrlPath(bucket))
    (segment,) = [one.name for one in store.list() if one.name.endswith(".mcap")]
    got = store.whole(segment, most_bytes=2**24)
    assert got is not None
    good = got[0]
    flipped = bytearray(good)
    flipped[len(good) // 2] ^= 1
    store.remove(segment)
    store.create(segment, bytes(flipped))
    with pytest.raises(LogError):
        fetched(bucket, cache)

    assert files(cache) == []
    store.remove(segment)
    store.create(segment, good)

    assert fetched(bucket, cache)[1] == events_of(RECORDINGS / "office")


def test_it_stays_within_its_bound_and_the_last_used_stay(tmp_path: Path) -> None:
    cache = ObjectCache(tmp_path / "cache", most_bytes=100_000)
    for number in range(50):
        cache.put("one", number, bytes([number]) * 10_000)
        for path in files(cache):  # as if a second lay between two uses
            os.utime(path, (path.stat().st_atime, path.stat().st_mtime - 1))
        assert cache.get("one", 0) == bytes(10_000)

    assert sum(path.stat().st_size for path in files(cache)) <= 100_000 + 10_032
    assert cache.get("one", 49) == bytes([49]) * 10_000
    assert cache.get("one", 1) is None


def test_what_a_killed_process_left_is_removed(tmp_path: Path) -> None:
    cache = ObjectCache(tmp_path / "cache")
    cache.put("one", 0, b"data")
    (kept,) = files(cache)
    old, new = kept.with_name(".old"), kept.with_name(".new")
    for path in (old, new):
        path.write_bytes(b"half")
    os.utime(old, (time.time() - 7200,) * 2)

    cache.sweep()

    assert {kept, new} == set(files(cache))


def test_eight_at_once(tmp_path: Path) -> None:
    """Threads with a cache of their own each, as processes have."""

    def used(number: int) -> None:
        cache = ObjectCache(tmp_path / "cache", most_bytes=200_000)
        for block in range(100):
            cache.put("one", block, bytes([block]) * 10_000)
            found = cache.get("one", (block * number) % 100)
            assert found in (None, bytes([(block * number) % 100]) * 10_000)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(used, range(8)))
    assert not list((tmp_path / "cache").rglob(".*"))


def test_a_full_disk_costs_no_answer(
    bucket: str, cache: ObjectCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(RECORDINGS / "office", UrlPath(bucket))

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)

    assert fetched(bucket, cache)[1] == events_of(RECORDINGS / "office")
    assert files(cache) == []


def test_nobody_else_may_look_into_it_and_it_goes_to_other_processes(cache: ObjectCache) -> None:
    cache.put("one", 0, b"data")

    assert cache.folder.stat().st_mode & 0o077 == 0
    assert pickle.loads(pickle.dumps(cache)).get("one", 0) == b"data"


def test_a_cache_that_cannot_be_is_an_error_and_none_costs_nothing(
    bucket: str, tmp_path: Path
) -> None:
    ship(RECORDINGS / "office", UrlPath(bucket))
    (tmp_path / "file").write_text("")

    with pytest.raises(LogAccessError, match="no cache can be there"):
        sl.read(bucket, cache=tmp_path / "file")
    assert sl.read(RECORDINGS / "office", cache=tmp_path / "unused").replay().doors


def test_by_option_by_environment_and_in_python(
    bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(RECORDINGS / "office", UrlPath(bucket))
    caches = [ObjectCache(tmp_path / str(number)) for number in range(3)]

    with pytest.raises(SystemExit, match="0"):
        main(["replay", bucket, "--cache", str(caches[0].folder)])
    _kept.clear()
    sl.read(bucket, cache=caches[1].folder).replay()
    environment = {**os.environ, VARIABLE: str(caches[2].folder)}
    subprocess.run(
        [sys.executable, "-m", "semmap_log", "replay", bucket], env=environment, check=True,
        capture_output=True,
    )  # fmt: skip

    assert [True] * 3 == [bool(files(cache)) for cache in caches]
    assert VARIABLE not in os.environ
    monkeypatch.setenv(VARIABLE, str(tmp_path / "4"))
    _kept.clear()
    sl.read(bucket).replay()
    assert (tmp_path / "4").is_dir()


def test_the_verbs_that_read_a_url_take_it_but_verify_which_believes_none() -> None:
    verbs = get_command(app).commands  # type: ignore[attr-defined]
    having = {
        name for name, verb in verbs.items() if any("--cache" in one.opts for one in verb.params)
    }

    assert "verify" not in having
    assert {"replay", "history", "why", "timeline", "probabilities", "view", "sql"} <= having
