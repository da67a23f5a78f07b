"""`go`: a trip through doors, and what to do at one that is shut."""

from __future__ import annotations

from typing import Annotated

import typer

from semmap_log.cli.common import AsJson, LogPath, check_map_recorded, console, print_json, progress
from semmap_log.cli.patrol_plan import SPEED_M_S, Speed, seconds_of
from semmap_log.cli.probabilities import Estimator, Zone


def run(
    log: LogPath,
    start_at: Annotated[
        str, typer.Argument(metavar="FROM", help="X,Y or X,Y,LEVEL in metres, a room, or a door.")
    ],
    goal_at: Annotated[str, typer.Argument(metavar="TO", help="The same.")],
    *,
    depart: Annotated[
        str | None,
        typer.Option("--depart", metavar="TIME", help="When; default: the log's end."),
    ] = None,
    speed: Speed = SPEED_M_S,
    asks: Annotated[
        bool, typer.Option("--asks", help="The robot may ask for doors that are shut.")
    ] = False,
    patience: Annotated[
        str | None,
        typer.Option(
            "--patience",
            metavar="30min",
            help="A wait counts up to that, as if the door were open then; default: all of it.",
        ),
    ] = None,
    estimator: Estimator = None,
    tz: Zone = None,
    as_json: AsJson = False,
) -> None:
    """Show how long a trip takes on average, and at each shut door whether to wait or go round.

    A door's P is that at the time of arrival. The expected wait is that of the door's own past,
    as in `best-time`, once the door was found shut. Doors on other ways count if one on the
    way is shut. A door of which too little was seen is UNKNOWN, and counts as the others do.

    \b
    Examples:
      semmap-log go office 2,1.5 room:2
      semmap-log go office 2,1.5 10,-4 --depart "2026-03-02T12:30" --asks
      semmap-log go office front room:3 --json
    """
    from semmap_log.analysis.planning.door_trip import door_trip
    from semmap_log.interop.formats.json.trip_json import trip_to_json
    from semmap_log.log import read
    from semmap_log.views.rebase_table import trip_table

    opened = read(log)
    check_map_recorded(opened, depart, None)
    with progress("Reading") as told:
        trip = door_trip(
            opened, start_at, goal_at, depart=depart, estimator=estimator, tz=tz,
            speed_m_s=speed, asks=asks, progress=told,
            patience_s=None if patience is None else seconds_of(patience, "--patience"),
        )  # fmt: skip
    if as_json:
        print_json(trip_to_json(trip))
        return
    console().print(trip_table(trip))
