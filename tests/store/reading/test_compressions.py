"""Chunks of any compression, with indexes or with wrong ones: the same events come out."""

from __future__ import annotations

import random
from pathlib import Path

import lz4.frame
import pytest

import semmap_log as sl
from semmap_log.store import chunks
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.compaction import compact, merge
from semmap_log.store.pages import Page
from semmap_log.store.reading.reader import LogReader
from tests.store.logs import answers, segment_files
from tests.test_replay import random_log


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """All kinds of events of doors, interleaved, fixed size and texts, in small commits."""
    random_log(tmp_path / "log", random.Random(5), commits=150)
    return tmp_path / "log"


@pytest.mark.slow
@pytest.mark.parametrize("compression", ["", "zstd", "lz4"])
def test_all_compressions_give_the_same_answers(
    compression: str, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Uncompressed, zstd, and lz4, which other tools write."""

    def packed(page: Page) -> BuiltChunk:
        return build_chunk(bytes(page.records), page.offsets, compression=compression)

    before = answers(log)
    if compression == "lz4":
        monkeypatch.setattr(chunks, "_compress", lz4.frame.compress)
    monkeypatch.setattr(merge, "_smallest", packed)
    compact(log)

    used = {chunk.compression for segment in LogReader(log).segments for chunk in segment.chunks}
    assert {compression} == used
    assert before == answers(log)


@pytest.mark.parametrize("is_compacted", [False, True])
def test_message_indexes_are_only_hints(is_compacted: bool, log: Path) -> None:
    """Whatever stands in them: the records are walked where it does not prove right."""
    if is_compacted:
        compact(log)
    before = [str(event) for batch in sl.read(log).batches(retracted=True) for event in batch]
    dice = random.Random(3)
    for path in segment_files(log):
        data = bytearray(path.read_bytes())
        for chunk in LogReader(log, only=path).segments[0].chunks:
            index = chunk.offset + chunk.length
            for at in range(index + 15, index + 31):
                data[at] = dice.randrange(256)
        path.write_bytes(data)

    after = [str(event) for batch in sl.read(log).batches(retracted=True) for event in batch]

    assert before == after
