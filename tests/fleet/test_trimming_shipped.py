"""Something is taken out of logs that were shipped: what lies elsewhere is not forgotten."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import LogError
from semmap_log.fleet.fetching import fetch
from semmap_log.fleet.keeping import remove_shipped
from semmap_log.fleet.shipping import ship
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.trimming.redaction import Notes, Redaction
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import plan_trimming, trim_log
from semmap_log.store.reading.reader import LogReader
from tests.log.trimming.logs import random_log
from tests.store.trimming.plain_chain import all_bytes


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return random_log(tmp_path, 3, monkeypatch, commits=150, roll=30)


def notes(log: Path) -> Redaction:
    return Redaction.of(LogReader(log), [Notes()], sl.read(log).last_event() + 1)


def test_what_lies_in_a_store_only_is_not_left_there_in_silence(
    log: Path, bucket: str, tmp_path: Path
) -> None:
    """A redaction is refused before anything is written; of a log that was fetched, it goes."""
    ship(log, UrlPath(bucket))
    assert remove_shipped(log, ObjectStore(UrlPath(bucket)), time.time_ns()).segments > 1
    before = {path.name: path.read_bytes() for path in log.iterdir()}

    for attempt in (trim_log, plan_trimming):
        with pytest.raises(LogError, match=r"segments that may hold it lie in a store only"):
            attempt(log, notes(log))

    assert {path.name: path.read_bytes() for path in log.iterdir()} == before
    fetched = tmp_path / "fetched"
    fetch(UrlPath(bucket), fetched)
    trim_log(fetched, notes(fetched))
    assert not [name for name, data in all_bytes(fetched) if b"anna" in data]
    assert verify(fetched).exit_code == 0


def test_old_sightings_in_a_store_stay_there(log: Path, bucket: str) -> None:
    """What is on the disk is thinned, and the log is whole."""
    ship(log, UrlPath(bucket))
    store = ObjectStore(UrlPath(bucket))
    commits = list(sl.read(log).commits())
    assert remove_shipped(log, store, commits[70].recorded_ns).segments

    done = trim_log(log, Thinning(LogReader(log), commits[-1].recorded_ns)).done

    assert done.events
    assert LogReader(log).segments[0].told is not None
    assert not [f for f in verify(log).findings if f.severity > 1]
