"""Warns about a queried span of time that reaches back to when the clock was not set."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import PurePath
from typing import Protocol

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import command_line, counted
from semmap_log.core.users_line import frames_of_ours
from semmap_log.errors import ClockWarning
from semmap_log.store.clock_check import NEVER_AFTER_NS, NEVER_BEFORE_NS
from semmap_log.store.header import LogInfo
from semmap_log.store.reading.window import Window


class ClockedLog(Protocol):
    """What is needed of a log: a `DoorLog`."""

    has_warned_of_clock: bool
    """Whether the warning was given."""

    @property
    def path(self) -> PurePath:
        """Where it lies."""

    @property
    def info(self) -> LogInfo:
        """What was fixed when it was made."""

    def happened_span(self) -> tuple[int, int] | None:
        """Return when its first and last event happened; None: it has none."""

    def batches_in(self, window: Window) -> Iterator[EventBatch]:
        """Yield the events of a window."""


def warn_of_clock(log: ClockedLog, since_ns: int | None = None) -> None:
    """Warn, once for a log, of events at times at which the robot's clock cannot have been right.

    They are dated before 2000, or after 2099, and others are not. If all are from such a time, they
    are consistent, and there is no warning.

    Args:
        log: The log.
        since_ns: What was before does not matter; None: all of it does.
    """
    if log.has_warned_of_clock:
        return
    first_ns, end_ns = believable_span(log)
    if first_ns is not None and (since_ns or 0) < first_ns:
        _warn(log, Window(happened_before_ns=first_ns), "before the robot's clock was set")
    if end_ns is not None:
        _warn(log, Window(happened_from_ns=end_ns), "where the robot's clock was wrong")


def believable_span(log: ClockedLog) -> tuple[int | None, int | None]:
    """Return from when and before when the clock can have been right, if some events are outside.

    None: no event lies beyond that end, or all do.
    """
    first_ns, last_ns = log.happened_span() or (NEVER_BEFORE_NS, NEVER_BEFORE_NS)
    return (
        NEVER_BEFORE_NS if first_ns < NEVER_BEFORE_NS <= last_ns else None,
        NEVER_AFTER_NS if first_ns < NEVER_AFTER_NS <= last_ns else None,
    )


def _warn(log: ClockedLog, window: Window, why: str) -> None:
    log.has_warned_of_clock = True
    batches = [batch.folds_ns for batch in log.batches_in(window) if len(batch)]
    ends_ns = min(map(min, batches)), max(map(max, batches))
    first, last = (format_local(int(ns), log.info.timezone)[:4] for ns in ends_ns)
    years = first if first == last else f"{first} to {last}"
    warnings.warn(
        f"{counted(sum(map(len, batches)), 'event')} happened in {years}, {why}: spans of time "
        f"that include {years} are wrong. To see the commits: {command_line('info', log.path)}",
        ClockWarning,
        stacklevel=frames_of_ours(),
    )
