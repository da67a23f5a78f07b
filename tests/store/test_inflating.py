"""What zlib packed is unpacked no further than it may be."""

from __future__ import annotations

import base64
import hashlib
import tracemalloc
import zlib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from semmap_log.core.io.inflating import inflated
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.state import unpacked
from semmap_log.store import record_scan
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.removed_source import RemovedSource
from semmap_log.store.removed_part import RemovedSegment

MIB = 2**20
BOMB = zlib.compress(bytes(64 * MIB))


def test_as_much_as_may_be_is_unpacked_and_no_more() -> None:
    """All of it, whatever its size; one byte less is an error."""
    assert bytes(1000) == inflated(zlib.compress(bytes(1000)), 1000)
    assert b"" == inflated(zlib.compress(b""), 0)
    with pytest.raises(ValueError, match="999 bytes unpacked, got more"):
        inflated(zlib.compress(bytes(1000)), 999)


@pytest.mark.parametrize("data", [b"", b"nonsense", BOMB[:-1], zlib.compress(b"x") + b"y"])
def test_what_is_damaged_is_an_error(data: bytes) -> None:
    """Cut, of another packing, or followed by something."""
    with pytest.raises(ValueError, match=r"expected zlib data|does not end where"):
        inflated(data, 64 * MIB)


@pytest.fixture
def little(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Lets a MiB be unpacked for nothing; hands out what tells the greatest memory since."""
    monkeypatch.setattr(record_scan, "FREE_CHUNK_BYTES", MIB)
    monkeypatch.setattr(record_scan, "MOST_RATIO", 10)
    tracemalloc.start()
    yield lambda: tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()


def test_the_state_in_a_pin_is_limited(little: Any) -> None:
    """Whoever may write a line into a log may write one."""
    assert unpacked(base64.b64encode(BOMB).decode()) is None
    assert little() < 4 * MIB


def test_what_is_kept_of_a_removed_segment_is_limited(tmp_path: Path, little: Any) -> None:
    """Its digest stands beside it, in a folder that may come from a stranger."""
    shipped: Any = SimpleNamespace(size=1000, sha256="00" * 32)
    removed = RemovedSegment("log.mcap", shipped, hashlib.sha256(BOMB).hexdigest())
    (tmp_path / removed.kept_name).write_bytes(BOMB)
    source = RemovedSource(LogFolder(tmp_path), removed, UrlPath("s3://bucket/log"))

    with pytest.raises(CorruptLogError, match="not what was written: expected at most"):
        source.read(0, 10)
    assert little() < 4 * MIB
