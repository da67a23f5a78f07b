"""The peer for reading: the mcap library with mcap-ros2-support's decoder, and a fold in Python."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmark.plain_fold import TOPICS, PlainFold


def mcap_replay(files: Sequence[Path], at_ns: int | None = None) -> PlainFold:
    """Return the fold of these segments' events that had happened by then.

    Only topics that matter to the doors are read. A log's event number is its `sequence`.
    """
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    fold = PlainFold()
    for path in files:
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for schema, _, message, said in reader.iter_decoded_messages(topics=TOPICS):
                happened_ns = min(message.publish_time, message.log_time)
                if schema is not None and (at_ns is None or happened_ns <= at_ns):
                    kind = schema.name.rpartition("/")[2]
                    fold.apply(kind, said, (happened_ns, message.sequence))
    return fold


def mcap_chunks(files: Sequence[Path]) -> int:
    """Open segments as the mcap library does; return how many chunks their summaries list."""
    from mcap.reader import make_reader

    total = 0
    for path in files:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
            assert summary is not None
            total += len(summary.chunk_indexes)
    return total
