"""A planned patrol, for people: the stops in their order, and what is left out, and why."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.planning.followed_round import FollowedRound, RoundStep
from semmap_log.analysis.planning.patrol_plan import NotVisited, PatrolPlan, PlannedStop
from semmap_log.analysis.planning.patrol_round import EXPECTED_P
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import SECOND_NS, duration, format_local, format_short
from semmap_log.core.texts import counted
from semmap_log.views.belief_words import MOST_NAMED, named, with_interval
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT, OTHER_STATE_COLOUR, SHORTEST_NAME, STATE_COLOURS


def patrol_plan_table(plan: PatrolPlan) -> RenderableType:
    """Return a row a stop, the targets left out, and the basis of the plan."""
    table = ColumnTable(_columns(with_targets=any(s.target.room is not None for s in plan.stops)))
    for number, stop in enumerate(plan.stops, start=1):
        table.add(*_row(number, stop, plan.tz))
    notes = [*_summary(plan), *_omitted(plan.left_out), *plan.notes]
    return Group(table, *(Text(line, style="dim") for line in notes))


def _columns(*, with_targets: bool) -> list[TableColumn]:
    return [
        TableColumn("stop", "#", right=True),
        TableColumn("target", "visit" if with_targets else None, least=SHORTEST_NAME),
        TableColumn("door_id"),
        TableColumn("door", "by door", least=SHORTEST_NAME),
        TableColumn("", "arrive"),
        TableColumn("arrives"),
        TableColumn("", "P (90 %)"),
        TableColumn("p"),
        TableColumn("low"),
        TableColumn("high"),
        TableColumn("wait_s", "wait", right=True, yields=2),
        TableColumn("or_by", "or by", least=SHORTEST_NAME, yields=3),
        TableColumn("why", "why", least=20, yields=1),
    ]


def _row(number: int, stop: PlannedStop, tz: str) -> Iterable[Cell]:
    short = format_short(stop.arrives_ns, tz).rpartition(" ")[2]
    if stop.is_known:
        likely = DoorState.OPEN if stop.p_passes >= EXPECTED_P else DoorState.CLOSED
        drawn = with_interval(stop.p_passes, stop.low, stop.high)
        chance = Text(drawn, style=STATE_COLOURS[likely])
        numbers = [f"{each:.4f}" for each in (stop.p_passes, stop.low, stop.high)]
    else:
        chance, numbers = Text("UNKNOWN", style=OTHER_STATE_COLOUR), [ABSENT] * 3
    wait: Cell = ABSENT
    if stop.wait_s is not None:
        wait = CellValue(duration(round(stop.wait_s) * SECOND_NS), f"{stop.wait_s:.0f}")
    return (
        str(number),
        Text(printable(stop.target.name)),
        str(stop.door.door_id),
        Text(printable(stop.door.label)),
        short,
        format_local(stop.arrives_ns, tz),
        chance,
        *numbers,
        wait,
        Text(", ".join(printable(door.label) for door in stop.others) or ABSENT),
        stop.why,
    )


def _summary(plan: PatrolPlan) -> list[str]:
    start, known = (format_short(ns, plan.tz) for ns in (plan.start_ns, plan.known_ns))
    when = start if start == known else f"{start}, as known at {known}"
    what = "P: that the door lets a robot in that may ask" if plan.options.asks else "P: of open"
    lines = [f"from {when} ({plan.tz}), by {plan.estimator}; {what}, at arrival"]
    if plan.stops:
        mean = duration(round(plan.mean_visit_s) * SECOND_NS)
        lines.append(
            f"{counted(len(plan.stops), 'stop')}, of which {plan.visits:.1f} let one in at once, "
            f"on average; mean time to visit {mean}"
        )
    return lines


def _omitted(left_out: Iterable[NotVisited]) -> list[str]:
    """Return a line for each reason; if few targets have different reasons, for each target."""
    by_words: dict[tuple[str, str], list[str]] = {}
    for each in left_out:
        words = each.said if each.reason != "shut" else ""
        by_words.setdefault((each.reason, words), []).append(each.name)
    lines = []
    for (reason, words), names in by_words.items():
        if reason == "shut":
            shut = [each for each in left_out if each.reason == "shut"]
            lines += [f"left out: {printable(each.name)}: {each.said}"
                      for each in shut[:MOST_NAMED]]  # fmt: skip
            if len(shut) > MOST_NAMED:
                others = named([each.name for each in shut[MOST_NAMED:]])
                lines.append(f"left out, shut, too: {others}")
        else:
            lines.append(f"left out, {words}: {named(names)}")
    return lines


STEP_ROW = (
    "event", "happened", "because", "target", "door_id", "door", "p", "low", "high", "arrives",
    "left", "why",
)  # fmt: skip
"""The columns of `step_row`, for programs."""


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
    """Return a step in words: when, what was reported, where to go, P then, and why."""
    begun = f"{format_short(step.at_ns, tz)}  {printable(step.because)}"
    if step.stop is None:
        return f"{begun}. {OVER[0].upper()}{OVER[1:]}."
    return f"{begun}. Next: {_stop_text(step.stop, tz)}; {step.left} left"


def over_line(round_: FollowedRound) -> str:
    """Return what became of a round that is over."""
    left = [target.name for target in round_.not_visited]
    said = f"visited: {named([target.name for target in round_.visited]) or 'nothing'}"
    return f"{said}; not visited: {named(left)}" if left else said


def _stop_text(stop: PlannedStop, tz: str) -> str:
    chance = with_interval(stop.p_passes, stop.low, stop.high) if stop.is_known else "UNKNOWN"
    arrives = format_short(stop.arrives_ns, tz).rpartition(" ")[2]
    where = printable(stop.target.name)
    if stop.target.room is not None:
        where = f"{where} by {printable(stop.door.label)}"
    return f"{where} ({stop.door.door_id}) at {arrives}, P {chance}, {stop.why}"


OVER = "the round is over"
