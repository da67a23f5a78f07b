"""A patrol round under way as lines: after an event, where the robot goes next."""

from __future__ import annotations

from semmap_log.analysis.planning.followed_round import FollowedRound, RoundStep
from semmap_log.analysis.planning.patrol_plan import PlannedStop
from semmap_log.core.model.moments import format_local, format_short
from semmap_log.views.belief_words import named, with_interval
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT

STEP_ROW = (
    "event", "happened", "because", "target", "door_id", "door", "p", "low", "high", "arrives",
    "left", "why",
)  # fmt: skip
"""What `step_row` says, for programs."""
OVER = "the round is over"


def step_row(step: RoundStep, tz: str) -> tuple[str, ...]:
    """Return a step as the cells of `STEP_ROW`."""
    stop = step.stop
    first = (str(step.event), format_local(step.at_ns, tz), step.because)
    if stop is None:
        return (*first, *[ABSENT] * 7, str(step.left), OVER)
    numbers = (stop.p_passes, stop.low, stop.high)
    return (
        *first, stop.target.name, str(stop.door.door_id), stop.door.label,
        *(f"{each:.4f}" if stop.is_known else ABSENT for each in numbers),
        format_local(stop.arrives_ns, tz), str(step.left), stop.why,
    )  # fmt: skip


def step_line(step: RoundStep, tz: str) -> str:
    """Return a step in words: when, what was told, where to go, P then, and why."""
    begun = f"{format_short(step.at_ns, tz)}  {printable(step.because)}"
    if step.stop is None:
        return f"{begun}. {OVER[0].upper()}{OVER[1:]}."
    return f"{begun}. Next: {_stop_in_words(step.stop, tz)}; {step.left} left"


def over_line(round_: FollowedRound) -> str:
    """Return what became of a round that is over."""
    left = [target.name for target in round_.not_visited]
    said = f"visited: {named([target.name for target in round_.visited]) or 'nothing'}"
    return f"{said}; not visited: {named(left)}" if left else said


def _stop_in_words(stop: PlannedStop, tz: str) -> str:
    chance = with_interval(stop.p_passes, stop.low, stop.high) if stop.is_known else "UNKNOWN"
    arrives = format_short(stop.arrives_ns, tz).rpartition(" ")[2]
    where = printable(stop.target.name)
    if stop.target.room is not None:
        where = f"{where} by {printable(stop.door.label)}"
    return f"{where} ({stop.door.door_id}) at {arrives}, P {chance}, {stop.why}"
