"""Logs for the tests of compaction, and what to compare of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.records import Metadata

import semmap_log as sl
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved, Event
from semmap_log.log.replay.keyframes import encode
from semmap_log.store.byte_layout import DIGEST_KEY, INDEX_METADATA, KEYFRAME_CHANNEL
from semmap_log.store.chunks import BuiltChunk
from semmap_log.store.compaction import compact
from semmap_log.store.header import _signed, index_metadata
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing.keyframe_source import KeyframeMessage, keyframe_chunk


def write_log(path: Path, commits: int, *, per_commit: int = 1, clock: Any = None) -> Path:
    """Write a log of a door that opens and closes; `clock` repeats if it must."""
    made = {"clock": clock} if clock else {}
    with sl.create(path, tz="UTC", compact=False, **made) as log:
        door = log.add_door(actor="survey", reason="first visit")
        for number in range(commits - 1):
            log.append(sightings(door, per_commit, number), sync=False)
        log.sync()
    return path


def see(log: sl.DoorLogWriter, count: int) -> None:
    """Observe door 1 so often, closed and open by turns."""
    for number in range(count):
        log.observe(DoorId(1), "open" if number % 2 else "closed")


def files_of(log: Path) -> dict[str, bytes]:
    """Return what the files of a log contain, its lock left out."""
    return {path.name: path.read_bytes() for path in log.iterdir() if path.name != ".lock"}


def sightings(door: DoorId, count: int, start: int = 0) -> Iterator[Event]:
    """Yield sightings of a door, no two the same."""
    for i in range(count):
        state = DoorState.OPEN if (start + i) % 2 else DoorState.CLOSED
        accuracy = 0.5 + ((start + i) % 1000) / 2000
        yield DoorObserved(door_id=door, state=state, accuracy_open=accuracy, accuracy_closed=0.9)


def close_as_before(path: Path) -> None:
    """Write a log's closed segments anew as they were closed before they told head and commands."""

    def index(*columns: Any) -> Metadata:
        with_head = index_metadata(*columns).metadata
        return _signed(
            INDEX_METADATA, {k: v for k, v in with_head.items() if k not in ("head", DIGEST_KEY)}
        )

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("semmap_log.store.segment.index_metadata", index)
        patch.setattr(SegmentWriter, "_write_command_index", lambda _: None)
        patch.setattr("semmap_log.store.compaction.merge.needs_compaction", lambda _: True)
        compact(path, merge=False)


def empty_keyframe(log_time_ns: int) -> BuiltChunk:
    """Return the chunk of a keyframe of a log without events."""
    return keyframe_chunk(KeyframeMessage(-1, encode(DoorMapState())), log_time_ns)


def segment_files(log: Path) -> list[Path]:
    """Return a log's segments, by name."""
    return sorted(log.glob("*.mcap"))


def digest_of_records(log: Path) -> str:
    """Return one digest of all records of a log but keyframes, in order, however chunked."""
    return digest_of_pages(LogReader(log))


def digest_of_pages(reader: LogReader) -> str:
    """Return the same of a log that is open."""
    whole = hashlib.sha256()
    for _, page in reader.pages():
        channels = page.heads["channel_id"].tolist()
        ends = [*page.offsets.tolist()[1:], len(page.records)]
        for channel, start, end in zip(channels, page.offsets.tolist(), ends, strict=True):
            if channel != KEYFRAME_CHANNEL:
                whole.update(page.records[start:end])
    return whole.hexdigest()


def answers(log: Path, *, moments: int = 8) -> dict[str, Any]:
    """Return what a log says to every question, at many moments, as texts that can be compared."""
    return answers_of(sl.read(log), moments=moments)


def answers_of(opened: sl.DoorLog, *, moments: int = 8) -> dict[str, Any]:
    """Return the same of a log that is open."""
    commits = list(opened.commits())
    recorded = [commit.closed_ns for commit in commits]
    chosen = recorded[:: max(1, len(recorded) // moments)]
    last = commits[-1].last_event if commits else -1
    numbers = range(0, last + 1, max(1, last // moments))
    return {
        "commits": [repr(commit) for commit in commits],
        "history": [repr(entry) for entry in opened.history()],
        "now": repr(opened.replay()),
        "at": [repr(opened.replay(at=ns)) for ns in chosen],
        "known at": [repr(opened.replay(known_at=ns)) for ns in chosen],
        "before": [repr(opened.replay(known_at=ns - 1)) for ns in chosen],
        "event": [repr(opened.replay(event=number)) for number in numbers],
        "entries": [repr(opened.entry(number)) for number in numbers],
        "records": digest_of_pages(opened._reader),
    }


def chunk_sizes(path: Path) -> list[tuple[str, int]]:
    """Return compression and uncompressed size of a segment's chunks."""
    return [(chunk.compression, chunk.size) for chunk in open_segment(path).chunks]
