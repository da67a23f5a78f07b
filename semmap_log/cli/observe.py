"""`observe`: a sensor saw a door."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, DoorName, WritableLog, check_not_nan, takes_about
from semmap_log.cli.door_options import StateOption, a_state_typed, state_given

if TYPE_CHECKING:
    from semmap_log.log import About


@takes_about
def run(
    log: WritableLog,
    door: DoorName,
    state: Annotated[
        str | None, typer.Argument(metavar="STATE", help="What was seen, such as open.")
    ] = None,
    *,
    seen: StateOption = None,
    accuracy: Annotated[
        float, typer.Option(help="P(the sensor reads right), 0.5..1, for open and closed alike.")
    ] = 1.0,
    accuracy_open: Annotated[
        float | None, typer.Option(help="P(reads open when it is open), if it differs.")
    ] = None,
    accuracy_closed: Annotated[
        float | None, typer.Option(help="P(reads closed when it is closed), if it differs.")
    ] = None,
    opening: Annotated[float | None, typer.Option(help="How far it stands open, 0..1.")] = None,
    as_json: AsJson = False,
    about: About,
) -> None:
    """Record a sighting: it sets the door's state, and is evidence for its probabilities.

    \b
    Examples:
      semmap-log observe office front open
      semmap-log observe office L1/coe_door closed --accuracy 0.9 --source lidar
      semmap-log observe office 3 open --at 2026-03-01T14:02
    """
    from semmap_log.cli.door_options import tell
    from semmap_log.log import append

    check_not_nan(opening=opening)
    state = state_given(state, seen)
    if state is None:
        raise typer.BadParameter("expected what was seen, such as open", param_hint="STATE")
    with append(log) as opened, a_state_typed():
        appended = opened.observe(
            door,
            state,
            accuracy=accuracy,
            accuracy_open=accuracy_open,
            accuracy_closed=accuracy_closed,
            opening=math.nan if opening is None else opening,
            **about,
        )
    tell(appended, as_json=as_json)
