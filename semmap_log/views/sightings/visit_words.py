"""What a visit says, in a few words under or over its picture."""

from __future__ import annotations

from math import isfinite

from semmap_log.analysis.scans.door_figures import is_undecided
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import format_short

ALMOST_SURE = 0.995


def verdict(visit: Visit) -> str:
    """Return what it says: `CLOSED .98`, `UNKNOWN: ajar`."""
    if visit.passed:
        return f"{visit.state.name}, driven through"
    if is_undecided(visit):
        return f"{visit.state.name}: {visit.why}" if visit.why else visit.state.name
    return f"{visit.state.name} {share(visit.accuracy)}"


def grounds(visit: Visit) -> str:
    """Return what that rests on: `12 looks: 0.0 through, 5.2 on the line, +0.03 m`."""
    looks, through, stopped = map(_about, (visit.looks, visit.through, visit.stopped))
    said = f"{looks} looks: {through} through, {stopped} on the line"
    is_told = isfinite(visit.behind_m) and visit.state is not DoorState.OPEN
    return f"{said}, {visit.behind_m:+.2f} m" if is_told else said


def when(visit: Visit, tz: str) -> str:
    """Return when it ended, on the clocks of a zone."""
    return format_short(visit.last_ns, tz)


def share(value: float) -> str:
    """Return a share of 1 with two digits, none before the point: `.98`; with more from `.995` on.

    What is not quite sure does not look so.
    """
    digits = 2 if value < ALMOST_SURE else 3
    while value < 1 and float(f"{value:.{digits}f}") >= 1:
        digits += 1
    text = f"{value:.{digits}f}"
    return text[1:] if text.startswith("0.") else text


def _about(number: float) -> str:
    return f"{number:.1f}" if number < 10 else f"{number:.0f}"
