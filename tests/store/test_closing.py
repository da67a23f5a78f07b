"""What closing a segment says of its commits: the hash of the last, and the index of commands."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import SeekingReader
from mcap.records import Attachment, Metadata

import semmap_log as sl
from semmap_log.core.model.events import DoorAnnotated
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.byte_layout import DIGEST_KEY
from semmap_log.store.compaction import compact
from semmap_log.store.header import _signed, index_metadata
from semmap_log.store.reading import segment_head, segment_scan
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import page_at
from semmap_log.store.verification import Severity
from semmap_log.store.verification.closing import SECTOR
from tests.store.eventful import eventful_log
from tests.store.logs import close_as_before, write_log

GOLDEN = Path(__file__).parents[1] / "golden" / "closed_without_head"


def as_it_is(_: Path) -> None:
    pass


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Several segments with something of everything."""
    return eventful_log(tmp_path / "log")


def attachments(segment: Path) -> list[Attachment]:
    with segment.open("rb") as file:
        return list(SeekingReader(file, validate_crcs=True).iter_attachments())


def index(segment: Path) -> dict[str, str]:
    """Return the entries of `semmap_index`, as mcap reads them."""
    with segment.open("rb") as file:
        records = list(SeekingReader(file).iter_metadata())
    return next(dict(r.metadata) for r in records if r.name == "semmap_index")


@pytest.mark.parametrize(
    "change",
    [as_it_is, lambda path: compact(path, merge=False), compact],
    ids=["as written", "compacted", "merged"],
)
def test_the_index_of_commands_is_that_of_the_commits(
    change: Callable[[Path], Any], log: Path
) -> None:
    """One row for each commit, ascending: fingerprint of its id, and its first event."""
    change(log)
    for segment in LogReader(log).segments:
        commits = list(LogReader(log, only=segment.path).commits())
        (stored,) = attachments(segment.path)

        expected = sorted(
            (int.from_bytes(hashlib.sha256(commit.command_id).digest()[:4], "little"),
             commit.first_event - segment.header.first_event)
            for commit in commits
        )  # fmt: skip
        rows = np.frombuffer(stored.data, [("event", "<u4"), ("fingerprint", "<u4")])
        assert expected == [(int(r["fingerprint"]), int(r["event"])) for r in rows]
        assert "semmap_commands" == stored.name
        assert segment.recorded[1] == stored.log_time == stored.create_time


@pytest.mark.parametrize(
    "change",
    [as_it_is, lambda path: compact(path, merge=False), compact, close_as_before],
    ids=["as written", "compacted", "merged", "closed as before"],
)
def test_the_head_is_the_hash_of_the_last_commit(change: Callable[[Path], Any], log: Path) -> None:
    """Each segment's is what the next one's header says; written where the segment is closed."""
    change(log)
    segments = LogReader(log).segments
    heads = [segment.head for segment in segments]

    assert [s.header.hash_so_far for s in segments[1:]] == heads[:-1]
    assert LogReader(log).last_commit().hash == heads[-1]
    stored = [index(segment.path).get("head") for segment in segments]
    was_before = change is close_as_before
    assert [None if was_before else head.hex() for head in heads] == stored


def test_the_head_of_a_closed_segment_is_told_without_its_chunks(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of one that was closed before, its last chunk of commits is read."""

    def refuse(*_: object) -> None:
        raise AssertionError("chunks were read")

    monkeypatch.setattr(segment_scan, "last_commit_in", refuse)

    assert all(segment.head for segment in LogReader(log).segments)
    with pytest.raises(AssertionError, match="chunks were read"):
        _ = LogReader(GOLDEN).segments[0].head


def test_the_head_of_a_live_segment_is_that_of_its_whole_commits(tmp_path: Path) -> None:
    """And without a commit, live or closed: that of the commit before it."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as log:
        assert bytes(32) == sl.read(path)._reader.segments[0].head
        log.add_door()
        (segment,) = sl.read(path)._reader.segments
        assert log._reader.last_commit().hash == segment.head
    sl.create(tmp_path / "empty", tz="UTC").close()
    (empty,) = sl.read(tmp_path / "empty")._reader.segments

    assert bytes(32) == empty.head
    assert [] == attachments(empty.path)
    assert () == verify(tmp_path / "empty").findings


def test_a_log_that_was_closed_without_them_is_good(log: Path) -> None:
    """A recording that shipped, and segments made like it: nothing is found."""
    close_as_before(log)

    assert "head" not in index(GOLDEN / "office_000000.mcap")
    assert [] == attachments(GOLDEN / "office_000000.mcap")
    assert () == verify(GOLDEN).findings
    assert () == verify(log).findings


def test_a_wrong_head_is_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All checksums are right, the hash is another's: only the chunks tell."""

    def wrong(*columns: Any) -> Metadata:
        events, least_ns, greatest_ns, _, behind = columns
        return index_metadata(events, least_ns, greatest_ns, bytes(32), behind)

    with monkeypatch.context() as patch:
        patch.setattr("semmap_log.store.segment.index_metadata", wrong)
        path = write_log(tmp_path / "log", 5)

    (found,) = verify(path).findings
    assert ("index", Severity.DAMAGE) == (found.kind, found.severity)
    assert "its last commit has the hash" in found.text


def test_a_wrong_index_of_commands_is_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All checksums are right, a fingerprint is another's: only the commits tell."""
    with monkeypatch.context() as patch:
        import semmap_log.store.writing.segment_chain  # noqa: F401 - not first under the patch

        patch.setattr("semmap_log.store.command_index.fingerprint", lambda _: 7)
        path = write_log(tmp_path / "log", 5)

    found = verify(path)
    assert 4 == found.exit_code
    assert "the index of commands" in found.findings[0].text


def test_a_head_that_is_no_hash_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By whoever asks for it, with the file; and by `verify`."""
    for text, problem in (("00ff", "expected a head of 32 bytes, got 2"), ("x", "hex")):

        def wrong(*columns: Any, text: str = text) -> Metadata:
            entries = dict(index_metadata(*columns).metadata)
            del entries[DIGEST_KEY]
            return _signed("semmap_index", {**entries, "head": text})

        with monkeypatch.context() as patch:
            patch.setattr("semmap_log.store.segment.index_metadata", wrong)
            path = write_log(tmp_path / f"log {len(text)}", 5)

        with pytest.raises(CorruptLogError, match=f"{path.name}_000000.*{problem}"):
            LogReader(path)
        assert 4 == verify(path).exit_code


def test_a_closing_that_lost_sectors_of_its_index_is_a_torn_tail(tmp_path: Path) -> None:
    """The magic is written once all before it is on the disk: without it nothing was promised."""
    path = write_log(tmp_path / "log", 400)
    (path / "metadata.yaml").unlink()  # which is written once the segment is closed
    (file,) = path.glob("*.mcap")
    whole = file.read_bytes()
    start = whole.find(b"semmap_commands")
    sectors = range(-(-start // SECTOR) * SECTOR, start + 400 * 8 - SECTOR, SECTOR)

    for at in sectors:
        file.write_bytes(whole[:at] + bytes(SECTOR) + whole[at + SECTOR : -8])
        found = verify(path)
        (torn,) = found.findings
        assert (3, "torn") == (found.exit_code, torn.kind)
        assert torn.text.endswith("the closing was not finished")
        assert 400 == found.commits
    assert len(sectors) >= 4
    with sl.append(path) as log:
        assert 399 == log.state.event
    assert 0 == verify(path).exit_code


def test_texts_that_look_like_commits_are_none(tmp_path: Path) -> None:
    """The ids are cut out of the records by the chunk's own index, not searched by their bytes."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as log:
        door = log.add_door()
        written = log._writer._chain.live
        assert written is not None
        text = bytes(page_at(LogReader(path).segments[0], 1).records).decode("latin-1")
        log.append([DoorAnnotated(door_id=door, key="k", value=text.replace("\0", "\1"))],
                   note=sl.Note(actor=text.replace("\0", "\1")))  # fmt: skip
        commits = list(LogReader(path).commits())

        assert [c.command_id for c in commits] == written.written.command_ids()
        assert [c.first_event for c in commits] == list(map(written.written.first_event, (0, 1)))
        assert commits[-1].hash == written.written.head


def test_heads_are_compared_by_what_is_written(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A segment is asked once: its head is kept."""
    asked: list[Path] = []

    def count(summary: Any) -> bytes | None:
        asked.append(summary.path)
        return segment_head.stored_head(summary)

    monkeypatch.setattr(segment_scan, "stored_head", count)
    (first, *_) = LogReader(log).segments

    assert first.head == first.head
    assert 1 == asked.count(first.path)
