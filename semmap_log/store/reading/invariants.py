"""What must be true from message to message: times grow, numbers have no gaps, commits chain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.commits import Durability
from semmap_log.errors import CorruptLogError
from semmap_log.store.byte_layout import COMMIT_CHANNEL, KEYFRAME_CHANNEL, NOTE_CHANNEL, kinds_of
from semmap_log.store.pages import Page
from semmap_log.store.record_scan import (
    ScannedChunks,
)

_SEQUENCE_MASK = 0xFFFF_FFFF


@dataclass(frozen=True, slots=True)
class ReadPosition:
    """Where a segment has got to, message by message."""

    next_event: int
    """Number of the event that must come next."""
    committed: int
    """Events below this number belong to a commit that is whole."""
    hash: bytes
    """Of the last commit."""
    log_time_ns: int = -1
    """Of the last message."""

    @property
    def is_whole(self) -> bool:
        """Whether no commit is under way."""
        return self.next_event == self.committed


@dataclass(frozen=True, slots=True)
class Places:
    """The reading position of a segment after each of some chunks, as columns."""

    start: ReadPosition
    next_event: NDArray[np.int64]
    committed: NDArray[np.int64]
    log_time_ns: NDArray[np.int64]
    commits: NDArray[np.intp]
    """How many commits there are up to the end of each."""
    hashes: NDArray[np.uint8]
    """Of these commits."""

    def __getitem__(self, chunk: int) -> ReadPosition:
        commits = int(self.commits[chunk])
        return ReadPosition(
            int(self.next_event[chunk]),
            int(self.committed[chunk]),
            self.hashes[commits - 1].tobytes() if commits else self.start.hash,
            int(self.log_time_ns[chunk]),
        )

    def last_whole(self, chunks: int) -> int | None:
        """Return the last of the first so many chunks that ends a commit, or has none begun."""
        whole = np.flatnonzero((self.next_event == self.committed)[:chunks])
        return int(whole[-1]) if len(whole) else None


@dataclass(frozen=True, slots=True)
class Violation:
    """The first message, of some that are read in order, that cannot be there."""

    message: int
    problem: str


def place_after(page: Page, start: ReadPosition) -> ReadPosition:
    """Return the reading position after a page that follows a position.

    Raises:
        CorruptLogError: It does not follow.
    """
    reading = Reading(page, np.array([len(page.heads)]))
    _, problem = reading.whole_chunks(start)
    if problem:
        raise CorruptLogError(page.path, page.offset, problem)
    return reading.places_after(start)[0]


class Reading:
    """Messages that follow a place, in order, whole chunks."""

    def __init__(
        self, page: Page, ends: NDArray[np.intp], rows: NDArray[np.void] | None = None
    ) -> None:
        """Take up messages.

        Args:
            page: Their records.
            ends: How many messages there are to the end of each chunk; each has at least one.
            rows: What the chunks' heads say: `start_ns` and `end_ns`; None: not looked at.
        """
        self._ends = ends
        self._rows = rows
        heads = page.heads
        self._channel = heads["channel_id"]
        self._log_time = heads["log_time"]
        self._sequence = heads["sequence"]
        self._is_event = kinds_of(self._channel) > 0
        self._events_to = np.cumsum(self._is_event)
        """How many events there are, up to and with each message."""
        self._commits_at = page.commit_places()
        self._commits = page.commit_rows(self._commits_at)

    def whole_chunks(self, start: ReadPosition) -> tuple[int, str]:
        """Return how many chunks fit, and what is wrong with the next; empty if all fit."""
        misfits = [violation for violation in self._violations(start) if violation is not None]
        if not misfits:
            return len(self._ends), ""
        first = min(misfits, key=lambda violation: violation.message)
        return int(np.searchsorted(self._ends, first.message, "right")), first.problem

    def places_after(self, start: ReadPosition) -> Places:
        """Return the reading position after each chunk, as if all of them fit."""
        last = self._ends - 1
        commits = np.searchsorted(self._commits_at, last, "right")
        committed = np.append(0, self._events_to[self._commits_at])[commits]
        return Places(
            start,
            start.next_event + self._events_to[last],
            np.where(commits > 0, start.next_event + committed, start.committed),
            self._log_time[last],
            commits,
            self._commits["hash"],
        )

    def _violations(self, start: ReadPosition) -> list[Violation | None]:
        numbers = start.next_event + self._events_to
        return [
            self._violation_of_chunk_times(),
            _first(self._is_unknown(), "a message on a channel that no log has"),
            _first(self._is_too_early(start), "a log time that is not after the one before"),
            _first(
                self._sequence != ((numbers - 1) & _SEQUENCE_MASK).astype(np.uint32),
                "an event number that does not follow the one before",
            ),
            _first(self._is_misshapen_commit(), "a Commit of a wrong size"),
            *self._misfits_of_commits(start, numbers),
        ]

    def _violation_of_chunk_times(self) -> Violation | None:
        if self._rows is None:
            return None
        chunk = first_violation(*times_of_chunks(self._log_time, self._ends), self._rows)
        if chunk is None:
            return None
        return Violation(int(self._ends[chunk - 1]) if chunk else 0, TIMES_VIOLATION)

    def _is_too_early(self, start: ReadPosition) -> NDArray[np.bool_]:
        """Each record has a later time than the one before; a keyframe may have the same."""
        step = np.diff(self._log_time, prepend=start.log_time_ns)
        early: NDArray[np.bool_] = step < (self._channel != KEYFRAME_CHANNEL)
        return early

    def _is_unknown(self) -> NDArray[np.bool_]:
        known = (COMMIT_CHANNEL, NOTE_CHANNEL, KEYFRAME_CHANNEL)
        unknown: NDArray[np.bool_] = ~(self._is_event | np.isin(self._channel, known))
        return unknown

    def _is_misshapen_commit(self) -> NDArray[np.bool_]:
        wrong: NDArray[np.bool_] = self._channel == COMMIT_CHANNEL
        wrong[self._commits_at] = False
        return wrong

    def _misfits_of_commits(
        self, start: ReadPosition, numbers: NDArray[np.int64]
    ) -> Iterator[Violation | None]:
        """Check that each Commit closes exactly the events since the last, and names its hash."""
        commits = self._commits
        if not len(commits):
            return
        reached = numbers[self._commits_at]
        first = np.append(start.committed, reached[:-1])
        wrong = (
            (commits["first_event"] != first)
            | (commits["count"] != reached - first)
            | (commits["count"] == 0)
            | (commits["durability"] > max(Durability))
        )
        hashes = np.vstack((np.frombuffer(start.hash, np.uint8), commits["hash"][:-1]))
        unchained = (commits["previous_hash"] != hashes).any(axis=1)
        for bad, problem in (
            (wrong, "a Commit that does not count the events before it"),
            (unchained, "a Commit that does not follow the commit before it"),
        ):
            yield _first(bad, problem, self._commits_at)


def _first(
    wrong: NDArray[np.bool_], problem: str, messages: NDArray[np.intp] | None = None
) -> Violation | None:
    """Return the first place that is wrong; `messages`: where the places lie among all."""
    places = np.flatnonzero(wrong) if messages is None else messages[wrong]
    return Violation(int(places[0]), problem) if len(places) else None


TIMES_VIOLATION = "its head does not tell the least and greatest log time of its messages"


KINDS_MISFIT = "it holds other kinds of messages than the segment's summary says"


def in_chunks(page: Page, ends: NDArray[np.int64]) -> ScannedChunks:
    """Return what is in the chunks of a page, by numpy.

    Args:
        page: Their records.
        ends: Where those of each end among them.
    """
    counts = np.searchsorted(page.offsets, ends)
    least_ns, greatest_ns = times_of_chunks(page.heads["log_time"], counts)
    return ScannedChunks(counts, kinds_of_chunks(page, counts), least_ns, greatest_ns)


def kinds_of_chunks(page: Page, ends: NDArray[np.intp]) -> NDArray[np.uint32]:
    """Return which kinds of record are in each chunk of a page: `pages`.

    Args:
        page: Their records.
        ends: How many messages there are to the end of each; each has at least one.
    """
    kinds: NDArray[np.uint32] = np.bitwise_or.reduceat(page.bits, np.append(0, ends[:-1]))
    return kinds


def times_of_chunks(
    log_time: NDArray[np.int64], ends: NDArray[np.intp]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the least log time of each chunk's messages, and the greatest.

    Args:
        log_time: Of all messages.
        ends: How many messages there are to the end of each chunk; each has at least one.
    """
    starts = np.append(0, ends[:-1])
    return np.minimum.reduceat(log_time, starts), np.maximum.reduceat(log_time, starts)


def first_violation(
    least_ns: NDArray[np.int64], greatest_ns: NDArray[np.int64], rows: NDArray[np.void]
) -> int | None:
    """Return the place of the first chunk that states other times than its messages, or None.

    Args:
        least_ns: The least log time of each chunk's messages.
        greatest_ns: The greatest.
        rows: What is stated about the chunks: `start_ns`, `end_ns`.
    """
    wrong = (least_ns != rows["start_ns"]) | (greatest_ns != rows["end_ns"])
    places: Sequence[int] = np.flatnonzero(wrong).tolist()
    return places[0] if places else None
