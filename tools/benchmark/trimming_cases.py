"""Cases: what is old, or tells who was where, taken out of a log for ever.

Beside us the mcap library's reader and writer copy a log without one topic: what people do who
filter a recording, and after which no hash chain can be verified any more.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from benchmark.case import Case, Peer, Work
from benchmark.folding import commit_sizes
from benchmark.logs import ZSTD, Sample, Workshop
from benchmark.patrol import POSE, START_NS, STEP_NS, blocks
from benchmark.peers import OURS
from benchmark.plain_fold import answer_of, plain_answer

if TYPE_CHECKING:
    from semmap_log.log.trimming.trim_log import TrimRule

POSES = "/semmap/robot_pose"
ROUNDS, LONG = 3, 1_000_000
"""From so many events on each does it once, and never for warming up."""

MakeRule = Callable[[Path, int], "TrimRule"]
"""Returns what is to be taken out of a log with so many events."""


def trimming_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: tracks redacted; old sightings thinned; the older half taken out."""
    log = shop.log(count, commit_sizes(count)[-1], ZSTD)
    few, doors = log.sample(), plain_answer(count)
    folder = shop.folder_for(f"care_{count}")
    mcap = Peer("mcap, copied without a topic", partial(_mcap, few, folder),
                _poses(count, few.count), few.count, "≥ 3x")  # fmt: skip
    for what, rule, gone, others in (
        ("Redact: tracks", _tracks, _poses(count, count), (mcap,)),
        ("Retain: old sightings thinned", _thinned, None, ()),
        ("Retain: the older half goes", _half, None, ()),
    ):  # fmt: skip
        ours = Peer(OURS, partial(_ours, log.path, folder, count, rule), (0, gone, doors), count)
        yield Case("care", what, "events/s", (ours, *others),
                   rounds or (1 if count >= LONG else ROUNDS), events=count,
                   warms_up=count < LONG, key=what)  # fmt: skip


def _poses(count: int, before: int) -> int:
    """Return how many of a patrol's events below a number are poses."""
    return sum(
        int(((rows["what"] == POSE) & (rows["number"] < before)).sum()) for rows in blocks(count)
    )


def _tracks(log: Path, count: int) -> TrimRule:
    from semmap_log.log.trimming.redaction import Redaction, Tracks

    del log
    return Redaction([Tracks()], count)


def _thinned(log: Path, count: int) -> TrimRule:
    from semmap_log.log.trimming.repeated_sightings import Thinning
    from semmap_log.store.reading.reader import LogReader

    return Thinning(LogReader(log), START_NS + count * STEP_NS)


def _half(log: Path, count: int) -> TrimRule:
    from semmap_log.log.trimming.trim_log import Retention
    from semmap_log.store.reading.reader import LogReader

    return Retention(LogReader(log), START_NS + count * STEP_NS // 2)


def _copies(log: Path, folder: Path) -> Iterator[Path]:
    """Yield a copy of a log for each turn; the one before goes."""
    while True:
        copy = folder / log.name
        shutil.rmtree(copy, ignore_errors=True)
        yield Path(shutil.copytree(log, copy))


def _ours(log: Path, folder: Path, count: int, rule: MakeRule) -> Work:
    import semmap_log as sl
    from semmap_log.log.replay.maintenance import verify
    from semmap_log.log.trimming.trim_log import trim_log

    def once(copy: Path) -> tuple[Path, int]:
        return copy, trim_log(copy, rule(copy, count)).done.events

    def answer(done: tuple[Path, int]) -> tuple[int, int | None, object]:
        copy, events = done
        gone = events if rule is _tracks else None
        return verify(copy).exit_code, gone, answer_of(sl.read(copy).replay())

    def note(done: tuple[Path, int]) -> str:
        left = sum(path.stat().st_size for path in done[0].glob("*.mcap"))
        before = sum(path.stat().st_size for path in log.glob("*.mcap"))
        return f"{left / before:.0%} of the bytes left"

    return Work(once, _copies(log, folder), answer, note)


def _mcap(sample: Sample, folder: Path) -> Work:
    from mcap.reader import make_reader
    from mcap.writer import Writer

    target = folder / "filtered.mcap"

    def once(_: None) -> int:
        left_out = 0
        with target.open("wb") as stream:
            writer = Writer(stream)
            writer.start()
            known: dict[int, int] = {}
            for path in sample.files:
                with path.open("rb") as source:
                    found = make_reader(source).iter_messages(end_time=sample.until_ns)
                    for schema, channel, message in found:
                        if channel.topic == POSES:
                            left_out += 1
                            continue
                        if channel.id not in known:
                            assert schema is not None, "each of ours has one"
                            number = writer.register_schema(
                                schema.name, schema.encoding, schema.data
                            )
                            known[channel.id] = writer.register_channel(
                                channel.topic, channel.message_encoding, number
                            )
                        writer.add_message(
                            known[channel.id], message.log_time, message.data,
                            message.publish_time, message.sequence,
                        )  # fmt: skip
            writer.finish()
        return left_out

    return Work(once)
