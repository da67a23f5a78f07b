"""Stores that send too much: no more is read than may come, and the error is one line."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from semmap_log.cli import main
from semmap_log.core.io.object_source import MOST_READ_BYTES, ObjectSource
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, OutputError
from semmap_log.fleet import shipping
from semmap_log.fleet.fetching import fetch
from semmap_log.fleet.jobs.lake_folder import LakeFolder
from semmap_log.fleet.shipping import ship
from semmap_log.store.byte_layout import MANIFEST_NAME, MOST_LIST_BYTES
from semmap_log.store.manifest import read_manifest
from tests.fleet.endless_store import (
    GIGABYTE,
    HUGE,
    Answering,
    all_huge,
    endless_errors,
    endless_errors_after_a_cut,
    endless_lists,
    endless_pages,
    endless_store,
    longer_ranges,
    small_by_head,
)
from tests.fleet.test_shipping import a_log

ON_ITS_WAY_BYTES = 2**24
"""At most so much waits in the system's buffers when a client leaves."""
MOST_RESIDENT_BYTES = 2**31


@pytest.mark.parametrize(
    "words", ["info", "replay", "verify", "tail", "fetch URL OUT", "ship LOG URL --check"]
)
def test_a_manifest_that_says_100_gb_is_not_read(
    words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By any verb that reads a store."""
    if "LOG" in words:
        a_log(tmp_path / "log", sessions=1)
    with endless_store(all_huge) as sent:
        where = f"{sent.url}/log"
        places = {"URL": where, "LOG": str(tmp_path / "log"), "OUT": str(tmp_path / "out")}
        given = words if "URL" in words else f"{words} URL"
        with pytest.raises(SystemExit) as ended:
            main([places.get(word, word) for word in given.split()])

    assert 1 == ended.value.code
    told = f"damaged: expected at most {MOST_LIST_BYTES:,} bytes, got {HUGE:,}"
    assert f"semmap-log: {where}/manifest.json: {told}\n" == capsys.readouterr().err
    assert sent.bytes < ON_ITS_WAY_BYTES


@pytest.mark.parametrize("answer", [all_huge, small_by_head, longer_ranges])
@pytest.mark.parametrize("size", [4096, GIGABYTE])
def test_no_more_of_an_object_is_read_than_was_asked_for(
    answer: Callable[[Answering], None], size: int
) -> None:
    """Whatever HEAD has said, and whatever a range is answered by."""
    with endless_store(answer) as sent:
        store = ObjectStore(UrlPath(f"{sent.url}/log"), patience_s=1.0)
        with pytest.raises(LogAccessError, match=r"/log/a\.mcap: "):
            store.part(ObjectStatus("a.mcap", size, ""), 0, 4096)

    assert sent.bytes < 4 * ON_ITS_WAY_BYTES


def test_what_is_said_to_be_one_long_piece_is_not_fetched() -> None:
    """Such as a chunk of a segment that has a terabyte, as a manifest says."""
    with endless_store(all_huge) as sent:
        status = ObjectStatus("a.mcap", 2**40, "")
        source = ObjectSource(ObjectStore(UrlPath(f"{sent.url}/log")), status)
        with pytest.raises(LogAccessError, match="in one piece, got a piece of"):
            source.read(0, MOST_READ_BYTES + 1)
        with pytest.raises(LogAccessError, match="in one piece"):
            source.read_ranges([(at, at + 2**20) for at in range(0, 2**28, 2**20)])

    assert 0 == sent.requests


_ASK = """
import sys
from semmap_log.errors import LogAccessError
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
store = ObjectStore(UrlPath(sys.argv[1]))
for ask in (store.list, lambda: store.status("x"), lambda: store.whole("x", most_bytes=9)):
    try:
        ask()
    except (LogAccessError, FileNotFoundError) as error:
        print(error)
"""


def _asked(url: str, endpoint: str) -> tuple[list[str], int]:
    """What a process of its own says of a store, and the most memory that it held."""
    named = {"AWS_ENDPOINT_URL": endpoint, "AWS_ACCESS_KEY_ID": "a" * 8,
             "AWS_SECRET_ACCESS_KEY": "b" * 8, "AWS_REGION": "us-east-1"}  # fmt: skip
    command = [sys.executable, "-c", _ASK, url]
    with subprocess.Popen(command, env=os.environ | named, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        said = process.stdout.read().decode().splitlines()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert 0 == process.returncode
    return said, used.ru_maxrss * 1024


@pytest.mark.parametrize(
    ("answer", "url"),
    [
        (endless_errors, "http"),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (
                (endless_errors, "s3"), (endless_errors_after_a_cut, "http"),
                (endless_lists, "http"), (endless_lists, "s3"), (endless_pages, "s3"),
            )
        ),
    ],
)  # fmt: skip
def test_lists_and_errors_without_end_do_not_fill_the_memory(
    answer: Callable[[Answering], None], url: str
) -> None:
    with endless_store(answer) as sent:
        place = f"{sent.url}/log" if url == "http" else "s3://bucket/log"
        said, most = _asked(place, sent.url)

    (told, *_) = [line for line in said if "the store cannot be reached: its answer fills" in line]
    assert told.startswith(place)
    assert told.endswith("and has no end.")
    assert len(said) <= 3
    assert most < MOST_RESIDENT_BYTES


def test_a_manifest_that_no_reader_would_take_is_not_put(
    bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = a_log(tmp_path / "log", sessions=1)
    monkeypatch.setattr(shipping, "MOST_LIST_BYTES", 400)

    with pytest.raises(LogError, match=r"expected at most 400 bytes, got .* compact"):
        ship(log, UrlPath(bucket))

    assert MANIFEST_NAME not in {each.name for each in ObjectStore(UrlPath(bucket)).list()}


def test_a_log_that_has_no_room_on_the_disk_is_not_fetched(bucket: str, tmp_path: Path) -> None:
    """By what the manifest says: nothing of it comes first."""
    ship(a_log(tmp_path / "log", sessions=1), UrlPath(bucket))
    store = ObjectStore(UrlPath(bucket))
    kept = read_manifest(store)
    assert kept is not None
    *others, last = kept.manifest.segments
    huge = replace(kept.manifest, segments=(*others, replace(last, size=2**60)))
    assert store.replace(MANIFEST_NAME, huge.text().encode(), kept.e_tag)

    with pytest.raises(OutputError, match="expected room for 1,152,921,5"):
        fetch(store.url, tmp_path / "back")

    assert not (tmp_path / "back").exists()


def test_a_footer_that_is_longer_than_its_file_is_damage(bucket: str) -> None:
    store = ObjectStore(UrlPath(f"{bucket}/month=2026-03"))
    store.create("x.parquet", b"PAR1" + (2**31).to_bytes(4, "little") + b"PAR1")

    with pytest.raises(CorruptLogError, match=r"x\.parquet: damaged: no Parquet file"):
        LakeFolder(bucket, "2026-03").put("x.parquet", iter(()))
