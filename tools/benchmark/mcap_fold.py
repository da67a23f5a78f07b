"""The peer that reads our files: the mcap library, with a fold in Python."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmark.logs import Sample
from benchmark.plain_fold import TOPICS, PlainFold

LATEST_NS = 5000 * 10**9
"""How far a range of recorded time must reach on: events are told an hour late, and only when
their commit of 100 is full."""
NO_EVENTS = ("Commit", "CommitNote", "Keyframe")


def mcap_replay(sample: Sample, at_ns: int | None = None) -> PlainFold:
    """Return the fold of those events that had happened by then.

    Only topics that matter to the doors are read. A log's event number is its `sequence`.
    """
    fold = PlainFold()
    for kind, message, said in _decoded(sample.files, topics=TOPICS, end_time=sample.until_ns):
        number, happened_ns = _stamp(message)
        if at_ns is None or happened_ns <= at_ns:
            fold.apply(kind, said, (happened_ns, number))
    return fold


def mcap_history(sample: Sample, door: int) -> list[tuple[int, int]]:
    """Return number and happened time of a door's events."""
    topics = (*TOPICS, "/semmap/door_requested")
    told = _decoded(sample.files, topics=topics, end_time=sample.until_ns)
    return [_stamp(message) for _, message, said in told if said.door_id == door]


def mcap_range(files: Sequence[Path], since_ns: int, until_ns: int) -> list[tuple[int, int]]:
    """Return number and happened time of what happened in a range; by the library's own index.

    That is of recorded time, so it is asked for a range that reaches further.
    """
    told = _decoded(files, start_time=since_ns, end_time=until_ns + LATEST_NS)
    stamps = (_stamp(message) for kind, message, _ in told if kind not in NO_EVENTS)
    return [stamp for stamp in stamps if since_ns <= stamp[1] < until_ns]


def mcap_chunks(files: Sequence[Path]) -> int:
    """Open segments as the mcap library does; return how many chunks their summaries list."""
    return sum(len(_summary(path).chunk_indexes) for path in files)


def compressed_share(files: Sequence[Path]) -> float:
    """Return which part of the records lies in compressed chunks."""
    chunks = [chunk for path in files for chunk in _summary(path).chunk_indexes]
    size: int = sum(chunk.uncompressed_size for chunk in chunks)
    compressed: int = sum(chunk.uncompressed_size for chunk in chunks if chunk.compression)
    return compressed / size


def stored_chunks(files: Sequence[Path]) -> Iterator[tuple[Path, int, str, int, int]]:
    """Yield of each chunk: file, offset, compression, bytes as stored, bytes of records."""
    for path in files:
        for chunk in _summary(path).chunk_indexes:
            yield (path, chunk.chunk_start_offset, chunk.compression, chunk.compressed_size,
                   chunk.uncompressed_size)  # fmt: skip


def _decoded(files: Sequence[Path], **which: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield type name, message and decoded content, in the order of recording."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    for path in files:
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for schema, _, message, said in reader.iter_decoded_messages(**which):
                assert schema is not None
                yield schema.name.rpartition("/")[2], message, said


def _stamp(message: Any) -> tuple[int, int]:
    """Return number and happened time of an event's message."""
    return message.sequence, min(message.publish_time, message.log_time)


def _summary(path: Path) -> Any:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return summary
