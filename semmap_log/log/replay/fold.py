"""Log + projection + a moment -> a state, from the log's start or on from a checkpoint."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from semmap_log.core.folds.projection import SAVE_EVERY_S, Projection
from semmap_log.core.io.progress import Progress
from semmap_log.log.replay.checkpoint import Checkpoint
from semmap_log.log.replay.position import Position
from semmap_log.log.replay.replay import Scope, visible_batches
from semmap_log.log.replay.running import RunningFold
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window

S = TypeVar("S")


def fold(
    reader: LogReader,
    projection: Projection[S],
    scope: Scope = Scope(),
    *,
    checkpoint: Path | None = None,
    save_every_s: float = SAVE_EVERY_S,
    progress: Progress | None = None,
) -> S:
    """Return the state that a projection makes of the events of a scope.

    Args:
        reader: Of the log.
        projection: The fold.
        scope: Which events count.
        checkpoint: File to go on from, if it is of an earlier moment, and to save to. It keeps
            states at the ends of commits, of all that had happened: another scope's answer may
            begin with it, and does not change it.
        save_every_s: How often it is saved at most, before the end.
        progress: Told how far the reading is.

    Raises:
        CheckpointError: The file is of something else, or the state cannot be stored in one.
        OutputError: It cannot be written.
        CorruptLogError: The log is damaged.
    """
    if checkpoint is None:
        return _from_the_start(reader, projection, scope, progress)
    file = Checkpoint(checkpoint, projection, reader)
    limit = scope.limit(reader)
    saved = file.load(reader)
    if saved is not None and not _is_earlier(saved[0], scope, limit):
        return _from_the_start(reader, projection, scope, progress)
    running = RunningFold(projection, saved, file, save_every_s=save_every_s)
    running.advance(reader, limit, at_ns=scope.at_ns, progress=progress)
    running.save()
    return running.state


def fold_part(
    reader: LogReader,
    projection: Projection[S],
    first: int,
    last: int,
    *,
    known_event: int | None = None,
) -> S:
    """Return the state that the events `first` to `last`, inclusive, make of `initial()`.

    Retractions count wherever in the log they are, up to the event `known_event` (None: as they are
    known now): so the states of parts that follow each other, merged, are that of the whole log.
    """
    hidden = reader.retractions(limit=known_event)
    state = projection.initial()
    for batch in reader.batches(Window(first_event=first, before_event=last + 1)):
        visible = hidden.visible(batch)
        if len(visible):
            state = projection.apply(state, visible)
    return state


def _from_the_start(
    reader: LogReader, projection: Projection[S], scope: Scope, progress: Progress | None
) -> S:
    state = projection.initial()
    for batch in visible_batches(reader, scope, progress=progress):
        state = projection.apply(state, batch)
    return state


def _is_earlier(position: Position, scope: Scope, limit: int | None) -> bool:
    """Tell whether all that was taken in up to there counts in the scope."""
    return (limit is None or position.event <= limit) and (
        scope.at_ns is None or position.latest_ns <= scope.at_ns
    )
