"""A fold under way: a state, how far it has come, and the checkpoint that keeps both."""

from __future__ import annotations

import time
from typing import Generic, TypeVar

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.projection import Projection
from semmap_log.core.io.progress import Progress
from semmap_log.log.replay import state
from semmap_log.store.reading.reader import LogReader

S = TypeVar("S")


class RunningFold(Generic[S]):
    """A projection's state, taken further along a log step by step."""

    def __init__(
        self,
        projection: Projection[S],
        saved: tuple[state.Position, S] | None = None,
        checkpoint: state.Checkpoint[S] | None = None,
        *,
        save_every_s: float,
    ) -> None:
        """Begin at what was saved, or at the log's start.

        Args:
            projection: The fold.
            saved: What the checkpoint holds.
            checkpoint: Keeps the state; None: nothing does.
            save_every_s: How often it is written at most, before the end.
        """
        self.position, self.state = saved or (state.Position(), projection.initial())
        self._projection = projection
        self._checkpoint = checkpoint
        self._save_every_s = save_every_s
        self._saved_at_s = time.monotonic()
        self._saved_event = self.position.event
        self._event = self.position.event
        self._latest_ns = self.position.latest_ns
        self._retractions = self.position.retractions
        self._hidden = state.hiding(self._retractions)
        self._commit_ends = state.NO_EVENT
        """No commit ends between the last event taken in and this one."""
        self._is_at_position = True
        """False while the state is ahead of the position, or in the projection's hands."""

    def advance(
        self,
        reader: LogReader,
        limit: int | None = None,
        *,
        at_ns: int | None = None,
        progress: Progress | None = None,
    ) -> bool:
        """Fold the events up to a number, or to the log's end; return whether it began again.

        It begins again if a retraction hides what was folded, something was redacted since, or the
        next events are gone.

        Args:
            reader: Of the log; it is known to hold the position.
            limit: The last event; None: the log's. In the middle of a commit: nothing is saved.
            at_ns: Only what had happened by then; then, too, nothing is saved.
            progress: Called with the progress of the reading.
        """
        later = state.retractions_after(reader, self.position.event, limit)
        so_far = self.position
        must_restart = (
            so_far.is_touched_by(later)
            or so_far.is_before_redaction(reader)
            or so_far.is_before_horizon(reader)
        )
        if must_restart:
            self._reset()
            later = state.retractions_after(reader, state.NO_EVENT, limit)
        self._retractions = (*self._retractions, *later)
        self._hidden = state.hiding(self._retractions)
        for batch in state.events_after(reader, self._event, limit, at_ns=at_ns, progress=progress):
            is_kept = int(batch.number[-1]) >= reader.horizon
            can_save = at_ns is None and is_kept and self._is_due()
            rest = self._save_on_the_way(reader, batch) if can_save else batch
            self._apply(rest, at_ns)
        is_further = at_ns is None and self._event != self.position.event
        commit = reader.find_commit(self._event) if is_further else None
        if commit is not None and commit.last_event == self._event:
            self._settle(commit.last_event, commit.hash)
        return must_restart

    def save_if_due(self) -> None:
        """Save, unless that was done a short while ago."""
        if self._is_due():
            self.save()

    def save(self) -> None:
        """Write the checkpoint, if there is something new to keep, at the end of a commit.

        Raises:
            CheckpointError: The state cannot be stored.
            OutputError: The file cannot be written; the last one is whole.
        """
        if not self._is_at_position or self._checkpoint is None:
            return
        if self.position.event != self._saved_event:
            self._checkpoint.save(self.position, self.state)
            self._saved_event = self.position.event
        self._saved_at_s = time.monotonic()

    def _reset(self) -> None:
        self.position, self.state = state.Position(), self._projection.initial()
        self._event, self._latest_ns, self._retractions = state.NO_EVENT, 0, ()

    def _apply(self, batch: EventBatch, at_ns: int | None = None) -> None:
        """Take in the next events, but for those that are hidden, or happened too late."""
        if not len(batch):
            return
        self._is_at_position = False
        visible = self._hidden.visible(batch)
        if at_ns is not None:
            visible = visible.select(visible.folds_ns <= at_ns)
        if len(visible):
            self.state = self._projection.apply(self.state, visible)
            self._latest_ns = max(self._latest_ns, int(visible.folds_ns.max()))
        self._event = int(batch.number[-1])

    def _settle(self, event: int, commit_hash: bytes) -> None:
        """Note that the state is that of the end of a commit."""
        so_far = tuple(one for one in self._retractions if one.number <= event)
        self.position = state.Position(event, commit_hash, self._latest_ns, so_far)
        self._is_at_position = True

    def _is_due(self) -> bool:
        waited_s = time.monotonic() - self._saved_at_s
        return self._checkpoint is not None and waited_s >= self._save_every_s

    def _save_on_the_way(self, reader: LogReader, batch: EventBatch) -> EventBatch:
        """Take in the whole commits of a batch, save, and return the rest of the batch."""
        first, last = int(batch.number[0]), int(batch.number[-1])
        if last < self._commit_ends:
            return batch
        commit = reader.find_commit(last)
        assert commit is not None, "every event belongs to a commit"
        self._commit_ends = commit.last_event
        whole, commit_hash = commit.last_event, commit.hash
        if whole != last:
            whole, commit_hash = commit.first_event - 1, commit.previous_hash
        if whole < first:
            return batch
        self._apply(batch.select(batch.number <= whole))
        self._settle(whole, commit_hash)
        if not self.position.is_touched_by(self._retractions):
            self.save()
        return batch.select(batch.number > whole)
