"""A projection's state during writing: after each commit, or those that came together."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from semmap_log.core.folds.projection import Projection
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.running import RunningFold
from semmap_log.log.replay.state import Checkpoint
from semmap_log.store.reading.following import are_same
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_scan import Segment

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class LiveState(Generic[S]):
    """A projection's state after a commit."""

    state: S
    """To look at: a projection may change it in place when it goes on."""
    event: int
    """The last event in it; -1: none."""
    was_restarted: bool = False
    """It was folded again from the log's start: a retraction hid what was in the state before,
    something was redacted, or what came next was no longer kept."""


def fold_live(
    reader: LogReader,
    projection: Projection[S],
    *,
    checkpoint: Path | None = None,
    save_every_s: float,
    poll_s: float,
    stop: Callable[[], bool] | None = None,
) -> Iterator[LiveState[S]]:
    """Yield the state of now at once, then one each time that commits came.

    The checkpoint is saved now and then, and when the iteration ends or is left, not if the
    projection fails: a state that it left half made is not kept.

    Args:
        reader: Of the log; it is refreshed.
        projection: The fold.
        checkpoint: File to go on from, and to save to.
        save_every_s: How often it is saved at most.
        poll_s: How long to wait before looking again, when nothing was new.
        stop: Called before each look; once it returns True, what is there then is the end.

    Raises:
        CheckpointError: The file is of something else, or the state cannot be stored in one.
        OutputError: It cannot be written.
        CorruptLogError: The log is damaged, or does not hold any more what was read before.
        LogError: Another log lies there now.
    """
    file = None if checkpoint is None else Checkpoint(checkpoint, projection, reader)
    saved = None if file is None else file.load(reader)
    running = RunningFold(projection, saved, file, save_every_s=save_every_s)
    seen: list[Segment] = []
    try:
        while True:
            is_last_look = stop is not None and stop()
            reader.refresh()
            if not are_same(seen, reader.segments):
                is_first_look = not seen
                seen = reader.segments
                before = running.position.event
                _check_continues(reader, running)
                was_restarted = running.advance(reader)
                if is_first_look or running.position.event != before:
                    yield LiveState(running.state, running.position.event, was_restarted)
            running.save_if_due()
            if is_last_look:
                return
            time.sleep(poll_s)
    finally:
        running.save()


def _check_continues(reader: LogReader, running: RunningFold[S]) -> None:
    """Check that the log still contains what was folded.

    Raises:
        CorruptLogError: It does not.
    """
    if not running.position.is_in(reader):
        raise CorruptLogError(
            reader.folder,
            0,
            f"the commit of event {running.position.event}, which was read before, is not there: "
            "the log was put back, or exchanged",
        )
