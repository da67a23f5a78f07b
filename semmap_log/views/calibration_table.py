"""A sensor's accuracies for people: each door's, all together, and what to type with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.sensor_calibration import Calibration, DoorCalibration, SensorHits
from semmap_log.core.model.doors import DoorId
from semmap_log.core.texts import command_line
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.health import pasteable, plain_lines
from semmap_log.views.tables import ABSENT

NAME_WIDTH = 14
TOGETHER = "together"


def calibration_table(
    calibration: Calibration,
    *,
    names: Mapping[DoorId, str] = MappingProxyType({}),
    log: Path = Path("LOG"),
) -> RenderableType:
    """Return the accuracies with their 90 % intervals, in 80 columns.

    Args:
        calibration: What was found.
        names: What the doors are called.
        log: Where the log is, for the line to type.
    """
    table = ColumnTable([TableColumn("door", "door", least=NAME_WIDTH), *_columns()])
    for door_id, door in calibration.doors.items():
        table.add(printable(names.get(door_id, str(door_id))), *_cells(door))
    table.add(TOGETHER, *_cells(calibration.together), style="bold")
    lines = ["in brackets: where it lies, nine times in ten; a pass is one visit"]
    if calibration.unseen:
        unseen = ", ".join(printable(names.get(d, str(d))) for d in calibration.unseen)
        lines.append(f"not seen while its state was known: {unseen}")
    to_type = pasteable(plain_lines(_to_type(calibration, log)))
    return Group(table, Text("\n".join(lines), style="dim"), Text(), to_type)


def _columns() -> Iterator[TableColumn]:
    """Yield the columns of the two states."""
    for state in ("open", "closed"):
        yield TableColumn("", f"reads {state}\nwhen {state}", right=True)
        yield TableColumn(f"accuracy_{state}")
        yield TableColumn(f"low_{state}")
        yield TableColumn(f"high_{state}")
        yield TableColumn(f"visits_{state}", "\nvisits", right=True, yields=1)


def _cells(door: DoorCalibration) -> tuple[Cell, ...]:
    return (*_hits(door.when_open), *_hits(door.when_closed))


def _hits(hits: SensorHits) -> tuple[Cell, ...]:
    """Return the accuracy as it is drawn, then alone and with its interval, and the visits."""
    visits = CellValue(f"{hits.visits:,}", str(hits.visits))
    if hits.accuracy is None:
        return *[ABSENT] * 4, visits
    exact = [f"{value:.3f}" for value in (hits.accuracy, *hits.interval)]
    return f"{exact[0]} [{exact[1]}, {exact[2]}]", *exact, visits


def _to_type(calibration: Calibration, log: Path) -> str:
    """Return the options with which to record sightings of that sensor from now on."""
    found = calibration.together
    options = [
        word
        for option, hits in (
            ("--accuracy-open", found.when_open),
            ("--accuracy-closed", found.when_closed),
        )
        if hits.visits
        for word in (option, f"{hits.declared:.3f}")
    ]
    said = f"type: {command_line('observe', log, 'DOOR', 'STATE', *options)}"
    missing = [
        state
        for state, hits in (("open", found.when_open), ("closed", found.when_closed))
        if not hits.visits
    ]
    if missing:
        said += f"\n(never seen while {missing[0]}: that accuracy stays unknown)"
    return said
