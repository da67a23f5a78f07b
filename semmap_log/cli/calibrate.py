"""`calibrate`: how often a sensor reads right."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, LogPath, console, print_json

if TYPE_CHECKING:
    from semmap_log.analysis.beliefs.trials import StateIntervals
    from semmap_log.core.model.doors import DoorId
    from semmap_log.log import DoorLog


def run(
    log: LogPath,
    *,
    truth: Annotated[
        Path,
        typer.Option("--truth", metavar="CSV", help="timestamp,door,state: what was true; or gz."),
    ],
    windows: Annotated[
        Path | None,
        typer.Option("--windows", metavar="CSV", help="door,start,end: when that is known at all."),
    ] = None,
    tz: Annotated[
        str | None,
        typer.Option(
            "--tz", metavar="ZONE", help="Zone of times without an offset; default: the log's."
        ),
    ] = None,
    source: Annotated[
        str | None, typer.Option("--source", help="Only sightings recorded with this source.")
    ] = None,
    door: Annotated[
        list[str] | None,
        typer.Option("--door", metavar="DOOR", help="Only this one; repeatable."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find a sensor's two accuracies from times in which the doors' true states are known.

    Somebody stood by, or a contact was fitted: the file says what was true, a row a change. A row
    holds until the door's next one; its last row ends what is known, unless --windows say when.
    Sightings of one pass count as one visit. Give each sensor its own run (--source).

    \b
    Examples:
      semmap-log calibrate office --truth contact.csv
      semmap-log calibrate office --truth contact.csv --source lidar --door front
    """
    from semmap_log.analysis.beliefs.sensor_calibration import calibrate
    from semmap_log.interop.formats.json.evaluation_json import calibration_to_json
    from semmap_log.log import read
    from semmap_log.views.health import calibration_table

    opened = read(log)
    chosen = {opened.resolve_any_door(name) for name in door} if door else None
    truths = _truths(opened, truth, windows, opened.info.timezone if tz is None else tz, chosen)
    found = calibrate(opened, truths, source=source)
    names = opened.door_names()
    if as_json:
        print_json(calibration_to_json(found, names=names))
    else:
        console().print(calibration_table(found, names=names, log=log))


def _truths(
    log: DoorLog, file: Path, windows: Path | None, tz: str, chosen: Collection[DoorId] | None
) -> Mapping[DoorId, StateIntervals]:
    """Return what a file says was true of the doors of a log."""
    from semmap_log.analysis.beliefs.sensor_calibration import truths_of_rows
    from semmap_log.interop.formats.files.door_csv import read_door_csv

    told = read_door_csv(file, windows=windows, tz=tz)
    ids = {name: log.resolve_any_door(name) for name in told.doors}
    return truths_of_rows(
        {
            name: rows
            for name, rows in told.by_door().items()
            if chosen is None or ids[name] in chosen
        },
        ids,
    )
