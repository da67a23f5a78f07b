"""A log as one HTML page in a file: written whole, or not at all."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.io.disk import check_outside_log, output_errors, replace_file
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import Time
from semmap_log.errors import FormatError
from semmap_log.log import DoorLog
from semmap_log.views.palette import DEFAULT, Palette
from semmap_log.views.report.content import report

SUFFIXES = (".html", ".htm")


@dataclass(frozen=True, slots=True)
class ReportWritten:
    """What was written."""

    doors: int
    events: int
    bytes: int


def write_report(
    log: DoorLog,
    out: Path,
    *,
    since: Time = None,
    until: Time = None,
    doors: Collection[DoorId] | None = None,
    tz: str | None = None,
    palette: Palette = DEFAULT,
    progress: Progress | None = None,
) -> ReportWritten:
    """Write the page; an old file of that name is replaced at once.

    Args:
        log: The log.
        out: The file, `.html` or `.htm`.
        since: From then on (happened time); the state before it opens the page.
        until: Before then.
        doors: Only these doors; None: all.
        tz: IANA zone of all times; None: the log's.
        palette: Colours of the states.
        progress: Called with how much has been read.

    Raises:
        FormatError: The name is not that of a page.
        MomentError: A time or the zone cannot be read.
        OutputError: The file cannot be written; what was there is whole.
    """
    if out.suffix.lower() not in SUFFIXES:
        raise FormatError(out, "expected a name that ends in .html.")
    check_outside_log(log.path, out)
    made = report(
        log, since=since, until=until, doors=doors, tz=tz, palette=palette, progress=progress
    )
    page = made.html.encode()
    with output_errors(out):
        replace_file(out, page)
    return ReportWritten(made.doors, made.events, len(page))
