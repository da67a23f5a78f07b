"""What was promised, in the table's words, and whether it was kept."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import ge, gt, le, lt

from benchmark.case import Case, Measured
from benchmark.peers import MCAP, OURS

Result = tuple[Case, list[Measured]]

MEMORY_MB = 200
"""Peak memory of whatever we do, the log as long as it may be: below this."""
MB = 10**6

_PROMISE = re.compile(r"(?P<sign>[≥≤<>]) (?P<bound>[\d.]+) ?(x|ms|%)")
_SIGNS = {"≥": ge, "≤": le, "<": lt, ">": gt}


@dataclass(frozen=True, slots=True)
class Growth:
    """How much longer a peer takes for the same in a larger log."""

    title: str
    peer: str
    from_events: int
    to_events: int
    times: float
    promise: str


def is_kept(promise: str, value: float | None) -> bool | None:
    """Tell whether a value is what was promised; None: nothing was, or there is no value.

    Args:
        promise: Such as `≥ 80x`, `< 150 ms`, `< 1 %`.
        value: In the unit of the promise.
    """
    if not promise or value is None:
        return None
    match = _PROMISE.fullmatch(promise)
    assert match is not None, promise
    return bool(_SIGNS[match["sign"]](value, float(match["bound"])))


def times_of(measured: Measured, peers: Sequence[Measured]) -> float | None:
    """Return how often our time goes into a peer's; None: it is compared with nobody."""
    ours = peers[measured.peer.beside]
    if measured is ours or measured.problem or ours.problem:
        return None
    return measured.median_s / ours.median_s


def speed_kept(measured: Measured, peers: Sequence[Measured]) -> bool | None:
    """Tell whether a peer's time, or how it stands to ours, is what was promised."""
    if measured.problem:
        return None
    promise = measured.peer.promise
    in_ms = promise.endswith("ms")
    return is_kept(promise, measured.median_s * 1e3 if in_ms else times_of(measured, peers))


def memory_kept(case: Case, measured: Measured) -> bool | None:
    """Tell whether we stayed below `MEMORY_MB`, or the case's own; None: that is not asked."""
    asked = case.has_memory and case.memory_promise and measured.peer.name.startswith(OURS)
    if not asked or measured.problem:
        return None
    return measured.peak_bytes < (case.memory_mb or MEMORY_MB) * MB


def growths(results: Sequence[Result]) -> Iterator[Growth]:
    """Yield how each peer's time grew from the smallest log to the largest."""
    keys = list(dict.fromkeys(case.key for case, _ in results if case.growth_promise is not None))
    for key in keys:
        sized = sorted(((case.events or 0, case, peers) for case, peers in results
                        if case.key == key), key=lambda one: one[0])  # fmt: skip
        least, case, small = sized[0]
        most, _, large = sized[-1]
        if least == most:
            continue
        known = {one.peer.name: one.median_s for one in small if not one.problem}
        for one in large:
            if not one.problem and one.peer.name in known and one.peer.name != MCAP:
                promise = case.growth_promise if one.peer.name.startswith(OURS) else ""
                times = one.median_s / known[one.peer.name]
                yield Growth(case.title, one.peer.name, least, most, times, promise or "")
