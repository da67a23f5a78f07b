"""Table of a scan report, for people: a row for each door, and those that need a look by name."""

from __future__ import annotations

from math import isfinite

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.scans.door_figures import DoorFigures, ScanReport
from semmap_log.core.texts import counted
from semmap_log.views.column_table import CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.sightings.visit_words import share

MARK = "!"
"""Of a door that a warning is about."""
MOST_NAMED = 12
"""Up to so many doors that were not met are listed by name."""


def scan_report_table(report: ScanReport) -> RenderableType:
    """Return a table of a row a door, in 80 columns, followed by notes on what is odd."""
    table = ColumnTable([
        TableColumn("door", "door", least=12),
        TableColumn("visits", "visits", right=True),
        TableColumn("open", "open", right=True),
        TableColumn("closed", "closed", right=True),
        TableColumn("undecided", "undecided", right=True),
        TableColumn("driven_through", "driven\nthrough", right=True, yields=3),
        TableColumn("said_accuracy", "said\naccuracy", right=True, yields=1),
        TableColumn("opening", "opening", right=True, yields=4),
        TableColumn("behind_m", "ends\nbehind", right=True, yields=2),
    ])  # fmt: skip
    for door in report.doors:
        table.add(*_cells(report, door))
    parts: list[RenderableType] = [table] if report.doors else [Text("no door was visited.")]
    return Group(*parts, *(Text(line, style="dim") for line in _below(report)))


def warning_lines(report: ScanReport) -> list[str]:
    """Return the warnings, with the doors' names."""
    about = [warning.about(report.label(warning.door_id)) for warning in report.warnings]
    return [printable(line) for line in (*about, *report.oddities)]


def _cells(report: ScanReport, door: DoorFigures) -> list[str | CellValue]:
    name = printable(report.label(door.door_id))
    mark = f" {MARK}" if report.warnings_of(door.door_id) else ""
    behind = door.behind_m.value
    return [
        CellValue(Text(f"{name}{mark}", style="bold" if mark else ""), name),
        *(str(n) for n in (door.visits, door.open, door.closed, door.undecided, door.passed)),
        _share(door.accuracy.value),
        _share(door.opening.value),
        CellValue(f"{behind:+.2f} m" if isfinite(behind) else "-", _told(behind, "+.3f")),
    ]


def _share(value: float) -> CellValue:
    return CellValue(share(value) if isfinite(value) else "-", _told(value, ".4f"))


def _told(value: float, form: str) -> str:
    return format(value, form) if isfinite(value) else "-"


def _below(report: ScanReport) -> list[str]:
    lines = []
    if report.not_met:
        named = [printable(report.label(door_id)) for door_id in report.not_met[:MOST_NAMED]]
        more = ", …" if len(report.not_met) > MOST_NAMED else ""
        lines.append(f"never met: {counted(len(report.not_met), 'door')}: {', '.join(named)}{more}")
    return ["", *lines] if lines else []
