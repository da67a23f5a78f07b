"""Files whose times are when it was known: a commit for each time, recorded then.

So history that was written by another program can be asked what was known at a moment. A log's
recorded times only grow: none of a file may be earlier than what the log has. What is of the same
time as the log's last commit is recorded just after it, as doors after the plan of one day.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from pathlib import Path

from semmap_log.core.batches.event_batch import EventBatch, one_by_one
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import format_local
from semmap_log.errors import FormatError
from semmap_log.interop.importing.import_plan import ImportPlan
from semmap_log.interop.importing.recorded_times import last_recorded_ns
from semmap_log.log.door_log.door_log_writer import DoorLogWriter

MOST_SORTED = 200_000
"""Of more events the file has to have them in order of time."""
SAME_TIME_NS = 1_000_000
"""By so much a file may begin before the log's end: each event of a commit takes a nanosecond."""
TOLD_EVERY = 1000
"""Commits between two words of progress."""


def append_as_recorded(
    log: DoorLogWriter, path: Path, plan: ImportPlan, *, note: Note, file_id: bytes,
    progress: Progress | None = None,
) -> int:  # fmt: skip
    """Append a file's events as commits that were recorded when they happened.

    Who is interrupted imports the file again: it goes on where it stopped.

    Returns:
        The first event's number.

    Raises:
        FormatError: An event has no time, or the log's order does not allow one.
        CommandError: The map forbids an event; what was before it is stored.
        LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
    """
    first_ns, last_ns = _span(path, plan)
    _check_order(log, path, first_ns, last_ns)
    if last_recorded_ns(log) is None and not log.begin_at(first_ns - 1):
        raise FormatError(path, "--as-recorded: the log had events before, so it has begun already")
    first_event: int | None = None
    ended_ns = last_recorded_ns(log) or 0
    done = 0
    for count, (at_ns, events) in enumerate(groupby(_in_order(path, plan), key=_time_of)):
        some = list(events)
        done += len(some)
        is_last = done == plan.count
        command_id = file_id if is_last else _id_at(file_id, at_ns)
        commit = log.take_over(
            _given(some), note=note, command_id=command_id, content=command_id, are_facts=False,
            recorded_ns=max(at_ns, ended_ns + 1),
        )  # fmt: skip
        ended_ns = commit.closed_ns
        first_event = commit.first_event if first_event is None else first_event
        if progress is not None and count % TOLD_EVERY == 0:
            progress(done, plan.count)
    log.sync()
    assert first_event is not None
    return first_event


def _span(path: Path, plan: ImportPlan) -> tuple[int, int]:
    """Return the first and the last time of a file's events.

    Raises:
        FormatError: One has none; or they are out of order, and too many to be sorted.
    """
    first_ns = last_ns = before_ns = -1
    is_ordered = True
    for times in _times(plan.events):
        for at_ns in times:
            if at_ns <= 0:
                raise FormatError(
                    path, "--as-recorded: expected a time of each event; this file says none: give "
                    "it with --since, or --at",
                )  # fmt: skip
            is_ordered &= at_ns >= before_ns
            before_ns = at_ns
            first_ns = at_ns if first_ns < 0 else min(first_ns, at_ns)
            last_ns = max(last_ns, at_ns)
    if not is_ordered and plan.count > MOST_SORTED:
        raise FormatError(
            path, f"--as-recorded: expected times in order, or at most {MOST_SORTED:,} events; "
            "sort the file by time",
        )  # fmt: skip
    return first_ns, last_ns


def _check_order(log: DoorLogWriter, path: Path, first_ns: int, last_ns: int) -> None:
    """Return if a log can have been told of all of it at its times.

    Raises:
        FormatError: It cannot.
    """
    zone, now_ns = log.info.timezone, log.now_ns()
    if last_ns > now_ns:
        raise FormatError(
            path, f"--as-recorded: expected times up to now, got {format_local(last_ns, zone)}"
        )
    ended_ns = last_recorded_ns(log)
    if ended_ns is not None and first_ns < ended_ns - SAME_TIME_NS:
        raise FormatError(
            path, "--as-recorded: recorded times only grow: expected no time before the log's "
            f"last commit, {format_local(ended_ns, zone)}, got {format_local(first_ns, zone)}; "
            "import it into a new log before anything else, or without --as-recorded",
        )  # fmt: skip


def _in_order(path: Path, plan: ImportPlan) -> Iterator[Event]:
    """Yield the events in order of time; those of one time as the file has them."""
    if plan.count > MOST_SORTED:
        yield from one_by_one(plan.events)
        return
    events = sorted(one_by_one(plan.events), key=_time_of)
    if len(events) != plan.count:
        raise FormatError(path, "it changed while it was imported; import it again")
    yield from events


def _time_of(event: Event) -> int:
    return event.happened_ns or 0


def _times(events: Iterable[Event | EventBatch]) -> Iterator[list[int]]:
    for each in events:
        if isinstance(each, EventBatch):
            yield each.happened_ns.tolist()
        else:
            yield [-1 if each.happened_ns is None else each.happened_ns]


def _given(events: list[Event]) -> Callable[[int], Iterable[Event]]:
    return lambda _: events


def _id_at(file_id: bytes, at_ns: int) -> bytes:
    return hashlib.sha256(file_id + f"known at {at_ns}".encode()).digest()[: len(file_id)]
