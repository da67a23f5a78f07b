"""Tells who asks about a span of time that it reaches back to when the clock was not set."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from semmap_log.common.texts import command_line, counted
from semmap_log.common.users_line import frames_of_ours
from semmap_log.domain.moments import format_local
from semmap_log.errors import ClockWarning
from semmap_log.store.clock_check import NEVER_AFTER_NS, NEVER_BEFORE_NS
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.door_log.door_log import DoorLog


def warn_of_clock(log: DoorLog, since_ns: int | None = None) -> None:
    """Warn, once for a log, of events at times at which the robot's clock cannot have been right.

    They lie before 2000, or after 2099, and others do not. Where all are from such a time, they fit
    together, and nothing is said.

    Args:
        log: The log.
        since_ns: What was before does not matter; None: all of it does.
    """
    if log.has_told_of_clock or (span_ns := log.happened_span()) is None:
        return
    first_ns, last_ns = span_ns
    if first_ns < NEVER_BEFORE_NS <= last_ns and (since_ns or 0) < NEVER_BEFORE_NS:
        _warn(log, Window(happened_before_ns=NEVER_BEFORE_NS), "before the robot's clock was set")
    if first_ns < NEVER_AFTER_NS <= last_ns:
        _warn(log, Window(happened_from_ns=NEVER_AFTER_NS), "where the robot's clock was wrong")


def _warn(log: DoorLog, window: Window, why: str) -> None:
    log.has_told_of_clock = True
    batches = [batch.folds_ns for batch in log.batches_in(window) if len(batch)]
    ends_ns = min(map(min, batches)), max(map(max, batches))
    first, last = (format_local(int(ns), log.info.timezone)[:4] for ns in ends_ns)
    years = first if first == last else f"{first} to {last}"
    warnings.warn(
        f"{counted(sum(map(len, batches)), 'event')} happened in {years}, {why}: spans of "
        f"time that include {years} are wrong. To see the commits: {command_line('info', log.path)}",
        ClockWarning,
        stacklevel=frames_of_ours(),
    )
