"""`probabilities`: how likely doors are open, and on what evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli import common

if TYPE_CHECKING:
    from semmap_log.analysis.beliefs.applying import Applied
    from semmap_log.analysis.beliefs.door_beliefs import TypicalWeek
    from semmap_log.core.model.doors import DoorId
    from semmap_log.log import About, DoorLog


PLOTS = (".png", ".svg")


class Grouping(str, Enum):
    """`semmap_log.interop.formats.json.beliefs_json.By`, as typer wants its choices."""

    hour = "hour"
    weekday = "weekday"
    week = "week"


Estimator = Annotated[
    str | None,
    typer.Option(
        "--estimator",
        metavar="NAME",
        help="filter, schedule, count, fremen5 or last; default: filter up to a day ahead, "
        "schedule beyond.",
    ),
]
Zone = Annotated[
    str | None, typer.Option("--tz", metavar="ZONE", help="The building's clocks; the log's.")
]


@common.takes_about
def run(
    log: common.LogPath,
    doors: Annotated[
        list[str] | None,
        typer.Argument(metavar="DOOR", help="Ids, names, or level/name; default: all."),
    ] = None,
    *,
    at: common.At = None,
    known_at: common.KnownAt = None,
    as_happened: common.AsHappened = False,
    horizon: Annotated[
        str, typer.Option("--horizon", metavar="2h", help="How long after that moment.")
    ] = "",
    estimator: Estimator = None,
    object_class: common.OfClass = None,
    tz: Zone = None,
    by: Annotated[
        Grouping | None, typer.Option("--by", help="Typical hours, days, or the week.")
    ] = None,
    when: Annotated[
        str | None,
        typer.Option("--when", metavar='"Tue 10:00"', help="A typical hour of the week."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="X.png", help="Draw that, the week unless --by; or .svg."),
    ] = None,
    apply: Annotated[
        bool,
        typer.Option("--apply", help="Append both numbers of all known doors as DoorUpdated."),
    ] = False,
    as_json: common.AsJson = False,
    about: About,
) -> None:
    """Show how likely each door is open, how sure that is, and on what evidence.

    Nothing counts but what had happened by the moment of the question: --at, with all that is known
    today, or --known-at, with what had been recorded by then. With --as-happened each event counts
    as recorded when it happened: what would have been believed then, had it been recorded at once,
    as `evaluate` does; in a log that was imported, nothing else is known of the past.

    A door of which too little is known is UNKNOWN. In brackets: a 90 % interval of P(open),
    somewhat narrow where little was seen.

    --when "Tue 10:00" answers another question: what the door is typically like then. --by shows
    all typical hours, days, or the whole week; never-seen ones are left empty. These rest on what
    was seen of the door alone, and are the same whenever you ask; --horizon 2h
    forecasts the hours to come from what was seen last.

    --apply writes P(open) and P(closed) into the log, one commit, for doors that are known and
    whose numbers differ: replay, costmap --by belief and the thesis's YAML have them then. They
    set no state and are no evidence. Who and why (--actor, --reason, …) is for it only.

    \b
    Examples:
      semmap-log probabilities office
      semmap-log probabilities office front --when "Tue 10:00"
      semmap-log probabilities office front --horizon 2h
      semmap-log probabilities office --at "yesterday 14:00" --json
      semmap-log probabilities office --known-at 2026-03-01T14:02
      semmap-log probabilities imported --at 2026-03-01T14:02 --as-happened
      semmap-log probabilities office front side --by week
      semmap-log probabilities office --plot weeks.png
      semmap-log probabilities office --apply --actor night-job
    """
    from semmap_log.analysis.beliefs.door_beliefs import probabilities
    from semmap_log.core.model.moments import parse_duration
    from semmap_log.interop.formats.json.beliefs_json import beliefs_to_json
    from semmap_log.log import read

    if when is not None and (by is not None or plot is not None):
        raise typer.BadParameter("shows one hour; leave it out, or --by and --plot",
                                 param_hint="--when")  # fmt: skip
    typical = when is not None or by is not None or plot is not None
    _check_useful(about, horizon=horizon, estimator=estimator, typical=typical, apply=apply)
    if plot is not None and plot.suffix not in PLOTS:
        raise typer.BadParameter(f"expected a name that ends in .png or .svg, got {plot}",
                                 param_hint="--plot")  # fmt: skip
    asked: dict[str, Any] = {
        "at": at, "known_at": known_at, "as_happened": as_happened, "estimator": estimator,
        "tz": tz, "doors": doors or None,
    }  # fmt: skip
    if object_class is not None:
        asked["doors"] = _of_class(read(log), object_class, asked)
    if typical:
        del asked["estimator"]
        _show_typical(log, asked, by, plot, when, as_json=as_json)
        return
    asked["horizon_ns"] = parse_duration(horizon) if horizon else 0
    opened, applied = read(log), None
    common.print_empty_log_hint(opened)
    with common.progress("Reading") as told:
        if apply:
            applied = _apply(log, asked, about, told)
            beliefs = applied.beliefs
        else:
            beliefs = probabilities(opened, **asked, progress=told)
    if not beliefs:
        _check_recorded(opened, asked)
    zone = opened.info.timezone if tz is None else tz
    if as_json:
        common.print_json(
            beliefs_to_json(beliefs, tz=zone, known_at_ns=opened.known_moment(known_at).ns)
            | (_applied_to_json(applied) if applied else {})
        )
        return
    from semmap_log.views.belief_table import belief_table

    common.console().print(belief_table(beliefs, tz=zone))
    if all(belief.evidence.is_empty for belief in beliefs) and not as_happened:
        common.note_later_events(opened, at, known_at)
    if applied is not None:
        _tell(applied)


def _of_class(opened: DoorLog, object_class: str, asked: Mapping[str, Any]) -> list[DoorId]:
    """Return the objects of a class that are in the map at the moment of the question.

    Raises:
        typer.BadParameter: Doors are named, too.
        CommandError: There is no such class.
    """
    from semmap_log.core.folds.levels import of_class

    if asked["doors"]:
        raise typer.BadParameter("name doors, or a class of them, not both", param_hint="--class")
    known_at = None if asked["as_happened"] else asked["known_at"]
    there = opened.replay(asked["at"] or asked["known_at"], known_at)
    return list(of_class(there, object_class).doors)


def _check_recorded(opened: DoorLog, asked: Mapping[str, Any]) -> None:
    """Refuse the answer that no door was in the map at the moment of the question.

    Raises:
        UnknownDoorError: Why there was none, and what to type.
    """
    from semmap_log.core.model.moments import format_local
    from semmap_log.core.texts import command_line
    from semmap_log.errors import UnknownDoorError

    moment = asked["at"] or asked["known_at"]
    since_ns = opened.before_first_ns()
    if moment is None or since_ns is None:
        return
    known_at = None if asked["as_happened"] else asked["known_at"]
    remedy = common.as_happened_line("probabilities", opened.path, *(asked["doors"] or ()))
    common.check_recorded(opened, moment, known_at, remedy=remedy)
    since = format_local(since_ns, opened.info.timezone)
    raise UnknownDoorError(
        f"no door is in the map then: the log has no events before {since}, or its doors were "
        f"removed by then; ask for a later time, or look at: {command_line('info', opened.path)}"
    )


def _check_useful(
    about: About, *, horizon: str, estimator: str | None, typical: bool, apply: bool
) -> None:
    """Refuse options that would change nothing: somebody meant something by them."""
    if typical and apply:
        raise typer.BadParameter(
            "writes the numbers of one moment", param_hint="--by, --plot, --when"
        )
    for option, value in (("--horizon", horizon), ("--estimator", estimator)):
        if typical and value:
            raise typer.BadParameter("a typical week has none; leave it out", param_hint=option)
    given = [
        f"--{name.replace('_', '-')}" for name, value in about.items() if value not in ("", None)
    ]
    if given and not apply:
        raise typer.BadParameter("says something about --apply", param_hint=", ".join(given))


def _show_typical(
    log: Path,
    asked: dict[str, Any],
    by: Grouping | None,
    plot: Path | None,
    when: str | None,
    *,
    as_json: bool,
) -> None:
    from semmap_log.analysis.beliefs.door_beliefs import typical_weeks
    from semmap_log.core.io.disk import check_outside_log
    from semmap_log.core.model.moments import parse_weekday
    from semmap_log.interop.formats.json.beliefs_json import weeks_to_json
    from semmap_log.log import read

    hour = None if when is None else parse_weekday(when)
    if when is not None and hour is None:
        raise typer.BadParameter(f'expected a day and an hour such as "Tue 10:00", got {when!r}',
                                 param_hint="--when")  # fmt: skip
    opened = read(log)
    common.print_empty_log_hint(opened)
    if plot is not None:
        check_outside_log(opened.path, plot)
    with common.progress("Reading") as told:
        weeks = typical_weeks(opened, **asked, progress=told)
    if not weeks:
        _check_recorded(opened, asked)
    which = by or Grouping.week
    if plot is not None:
        _plot(weeks, plot, which)
        if by is None and not as_json:
            return
    if as_json:
        zone = opened.info.timezone if asked["tz"] is None else asked["tz"]
        known_at_ns = opened.known_moment(asked["known_at"]).ns
        common.print_json(
            weeks_to_json(weeks, which.value, hour=hour, tz=zone, known_at_ns=known_at_ns)
        )
        return
    _print_weeks(weeks, which, hour)


def _plot(weeks: Sequence[TypicalWeek], plot: Path, by: Grouping) -> None:
    from semmap_log.views.plots.typical_weeks import MOST_PANELS, drawn_of, plot_weeks

    if not weeks:
        common.say(f"{plot}: not written; no door is in the map then.")
        return
    plot_weeks(weeks, plot, by.value)
    others = "; to draw others, name them as DOOR" if len(weeks) > MOST_PANELS else ""
    common.say(f"{plot}: {drawn_of(len(weeks))}{others}.")


def _print_weeks(weeks: Sequence[TypicalWeek], by: Grouping, hour: tuple[int, int] | None) -> None:
    from semmap_log.views.week_map import hour_rows, hour_table, week_maps, weekday_rows

    if not weeks:
        common.say("no door is in the map then.")
        return
    if hour is not None:
        common.console().print(hour_table(weeks, *hour))
        return
    show = {Grouping.hour: hour_rows, Grouping.weekday: weekday_rows, Grouping.week: week_maps}
    common.console().print(show[by](weeks))


def _apply(log: Path, asked: dict[str, Any], about: About, told: Any) -> Applied:
    from semmap_log.analysis.beliefs.applying import apply_probabilities
    from semmap_log.core.model.commits import Note
    from semmap_log.log import append

    note = Note(actor=about["actor"], source=about["source"], reason=about["reason"],
                   correlation=about["correlation"])  # fmt: skip
    with append(log) as opened:
        return apply_probabilities(
            opened, **asked, note=note, command_id=about["command_id"],
            expected_event=about["expected_event"], progress=told,
        )  # fmt: skip


def _applied_to_json(applied: Applied) -> dict[str, Any]:
    appended = applied.appended
    return {
        "applied": {
            "event": None if appended is None else appended.first_event,
            "count": 0 if appended is None else appended.count,
            "repeated": appended is not None and appended.repeated,
            "doors": [belief.door.door_id for belief in applied.written],
            "unknown": [belief.door.door_id for belief in applied.unknown],
        }
    }


def _tell(applied: Applied) -> None:
    from semmap_log.views.belief_words import labels_in, named

    appended = applied.appended
    if appended is None:
        common.say("nothing was written: no door's numbers changed.")
    elif appended.repeated:
        common.say(f"stored before, from event {appended.first_event} on; nothing was written now.")
    else:
        last = appended.first_event + appended.count - 1
        doors = "door has" if appended.count == 1 else "doors have"
        common.say(f"events {appended.first_event}..{last}: {appended.count} {doors} now both "
            "probabilities in the map.")  # fmt: skip
    if applied.unknown:
        common.say(f"left alone, UNKNOWN: {named(labels_in(applied.unknown))}")
