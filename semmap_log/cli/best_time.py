"""`best-time`: when a door is likeliest to be open."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

import typer

from semmap_log.cli import common
from semmap_log.cli.probabilities import Estimator, Zone


class State(str, Enum):
    """`semmap_log.analysis.beliefs.best_times.State`, as typer wants its choices."""

    open = "open"
    closed = "closed"


def run(
    log: common.LogPath,
    door: common.DoorName,
    *,
    state: Annotated[
        State, typer.Option("--state", help="Likeliest in which state.", case_sensitive=False)
    ] = State.open,
    at: common.At = None,
    known_at: common.KnownAt = None,
    as_happened: common.AsHappened = False,
    estimator: Estimator = None,
    tz: Zone = None,
    most: Annotated[
        int, typer.Option("-n", min=1, max=168, metavar="N", help="So many of each.")
    ] = 5,
    as_json: common.AsJson = False,
) -> None:
    """Show when to go: the next hours, and hours of the week, in which a door is likeliest open.

    Neighbouring hours that are about as good are one row. Hours of the week in which the door was
    never seen are left out. The expected wait is how long it takes on average, from now on, until
    the door is in that state. What was imported counts as recorded when it was imported: of a
    time before that, ask --at, or --known-at with --as-happened.

    \b
    Examples:
      semmap-log best-time office front
      semmap-log best-time office L1/front --state closed -n 3
      semmap-log best-time office front --at "yesterday 14:00" --json
    """
    from semmap_log.analysis.beliefs.best_times import best_time
    from semmap_log.errors import UnknownDoorError
    from semmap_log.interop.formats.json.beliefs_json import best_time_to_json
    from semmap_log.log import read
    from semmap_log.views.timeline_table import best_time_table

    opened = read(log)
    with common.progress("Reading") as told:
        try:
            found = best_time(
                opened, door, state.value, at=at, known_at=known_at, as_happened=as_happened,
                estimator=estimator, tz=tz, most=most, progress=told,
            )  # fmt: skip
        except UnknownDoorError:
            if not as_happened:
                line = common.as_happened_line("best-time", log, door)
                common.check_recorded(
                    opened, at, known_at, door=opened.resolve_any_door(door), remedy=line
                )
            raise
    if as_json:
        common.print_json(best_time_to_json(found, known_at_ns=opened.known_moment(known_at).ns))
        return
    common.console().print(best_time_table(found))
