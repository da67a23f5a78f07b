"""What a time means that somebody asks a log about, or tells it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

import numpy as np

from semmap_log.core.model.events import is_whole_number
from semmap_log.core.model.moments import INSTANTS, SECOND_NS, Moment, parse_moment
from semmap_log.errors import MomentError

Time = int | str | date | np.datetime64 | Moment | None
"""Nanoseconds UTC, a text as on the command line (`2026-03-01T14:02`, `2h ago`, `event:12`), a
datetime, date or pandas Timestamp (without a zone it is in the log's), a numpy.datetime64 (UTC), or
what `moment` made of one."""


UNITS = {"seconds": 10**9, "milliseconds": 10**12, "microseconds": 10**15}
"""What a number may be of instead, from 2001 to 2286, from so many on to ten times as many."""
NEAR_NS = 10 * 60 * SECOND_NS
"""What happened so long before or after a moment is near it."""


def moment_of(
    time: Time,
    *,
    tz: str,
    end_ns: Callable[[], int],
    last_ns: Callable[[], int] | None = None,
) -> Moment:
    """Return what a time means in a log.

    Args:
        time: A moment in any of its forms.
        tz: The log's zone.
        end_ns: Returns what `now` is, and `2h ago` counts from; called only where that matters.
        last_ns: Returns up to when `14:02` is the last one; default: `end_ns`.

    Raises:
        MomentError: It cannot be read.
    """
    if time is None:
        return Moment()
    if isinstance(time, Moment):
        return time
    if isinstance(time, date):
        time = time.isoformat()
    elif isinstance(time, np.datetime64):
        time = int(time.astype("datetime64[ns]").astype(np.int64))
    if isinstance(time, str):
        return parse_moment(time, tz=tz, end_ns=end_ns, last_ns=last_ns)
    if not is_whole_number(time):
        raise MomentError(
            f"expected a time as whole nanoseconds since 1970, a text such as {INSTANTS}, or a "
            f"datetime; got {time!r}."
        )
    return Moment(ns=int(time))


def refuse_other_units(time: int, first_ns: Callable[[], int | None]) -> None:
    """Refuse a number that would be in January 1970 as nanoseconds, in a log that begins later.

    Args:
        time: Nanoseconds.
        first_ns: Returns when the log begins; called only for a number of that time.

    Raises:
        MomentError: It is one, and says which unit it may be of.
    """
    for unit, least in UNITS.items():
        if least <= time < 10 * least and (first_ns() or 0) > 100 * UNITS["microseconds"]:
            factor = 10**18 // least
            raise MomentError(
                f"expected a time as whole nanoseconds since 1970, got {time}, which looks like "
                f"{unit}; multiply by {factor:_}."
            )


def happened_ns_of(time: Time, *, tz: str, now_ns: int) -> int | None:
    """Return when something happened by what is said of it; None: that is not said.

    Args:
        time: A moment in any of its forms, but for the number of an event.
        tz: The log's zone.
        now_ns: What `now` is, and `2h ago` counts from.

    Raises:
        MomentError: It cannot be read, or is the number of an event.
    """
    moment = moment_of(time, tz=tz, end_ns=lambda: now_ns)
    if moment.event is not None:
        raise MomentError(
            f"expected when it happened, a time such as {INSTANTS}; got the number of event "
            f"{moment.event}, of whose time `show` tells."
        )
    return moment.ns
