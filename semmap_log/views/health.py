"""Describe the health of a log, for `verify`, `recover` and `info`; fits 80 columns.

Also a sensor's accuracies for people: each door's, all doors together, and the command to set them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from semmap_log.analysis.beliefs.sensor_calibration import Calibration, DoorCalibration, SensorHits
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import command_line, counted
from semmap_log.log import Finding, Severity, Verification
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT

if TYPE_CHECKING:
    from pathlib import PurePath

    from semmap_log.log import Loss, Recovered, RecoveryPlan, SignedVerification


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
        calibration: The accuracies found.
        names: The doors' names.
        log: The log's path, for the suggested command.
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
    """Return the accuracy as drawn, then alone and with its interval, and the visits."""
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


VERDICTS = {0: "good", 3: "torn tail", 4: "damaged", 5: "not a log", 6: "unsigned end"}
"""Exit code of `verify` -> its meaning."""

SEVERITY_STYLES = {
    "NOTE": "dim",
    "WARNING": "yellow",
    "TORN": "yellow",
    "UNSIGNED": "yellow",
    "NOT_AS_SIGNED": "red",
    "DAMAGE": "red",
    "NOT_A_LOG": "red",
}
MOST_NOTES = 20
"""Limit for suspect clocks and the like; damage is always shown in full."""


def verdict(found: Verification) -> str:
    """Return the state of a log in a few words."""
    if found.of(Severity.NOT_AS_SIGNED) and not found.of(Severity.DAMAGE, Severity.NOT_A_LOG):
        return "not as signed"
    return VERDICTS[found.exit_code]


def signed_verification_report(done: SignedVerification) -> RenderableType:
    """Return the same of a log whose signatures were checked, and up to where it is signed."""
    good = f"{done.good:,} of {counted(done.statements, 'statement')} good"
    reach = f"up to event {done.signed_before - 1}" if done.signed_before else "no event"
    by = [plain_text(f"  by {key}") for key in done.by]
    return verification_report(done.found, [Text(f"signed {reach}; {good}"), *by, *_times(done)])


def _times(done: SignedVerification) -> list[Text]:
    """Return which statement has a time stamp, if any has."""
    stamped = sum(time is not None for _, time in done.times)
    if not stamped:
        return []
    said = f"{counted(stamped, 'time stamp')}; openssl ts -verify checks whose"
    each = [f"  {path.name}  {time or 'no time stamp'}" for path, time in done.times]
    return [Text(said), *map(plain_text, each)]


def verification_report(found: Verification, signed: Sequence[Text] = ()) -> RenderableType:
    """Return what was read, the findings, and what to do about them.

    Args:
        found: The findings.
        signed: Lines about its signatures; empty: they were not checked.
    """
    if found.exit_code == 5:
        return Group(*(plain_text(f"{f.path}: {f.text}") for f in found.findings))
    checked = (
        f"{counted(found.events, 'event')} in {counted(found.commits, 'commit')}, "
        f"{found.size / 1e6:,.1f} MB in {counted(found.segments, 'file')}"
    )
    said = Text.assemble(plain_text(str(found.path)), f": {verdict(found)}; {checked}")
    parts: list[RenderableType] = [said]
    since = found.events_after_head
    if since is not None:
        parts.append(Text(f"contains the given head, and {counted(since, 'event')} after it"))
    parts += signed
    notes = 0
    for finding in found.findings:
        notes += finding.severity.name == "NOTE"
        if notes <= MOST_NOTES or finding.severity.name != "NOTE":
            parts += _finding(finding)
    if notes > MOST_NOTES:
        parts.append(Text(f"… and {notes - MOST_NOTES} more notes (all: --json)", style="dim"))
    parts.append(Text(f"head {found.head.hex()}"))
    if found.exit_code == 0 and since is None and not signed:
        parts.append(head_hint(found.path))
    if todo := _what_to_do(found):
        parts.append(pasteable(plain_lines(todo)))
    return Group(*parts)


def head_hint(log: PurePath) -> Group:
    """Return the advice on how to use a log's head."""
    line = command_line("verify", log, "--head", "HASH")
    return Group(
        Text("Keep the head elsewhere; a cut tail then shows:", style="dim"),
        pasteable(plain_text(f"  {line}")),
    )


def pasteable(text: Text) -> Text:
    """Return text whose lines never break, since one is to be pasted. Print it uncropped."""
    text.no_wrap, text.overflow = True, "ignore"
    return text


def events_text(events: tuple[int, int | None]) -> str:
    """Return which events, in words."""
    first, last = events
    if last is None:
        return f"events from {first} on"
    return f"event {first}" if first == last else f"events {first}..{last}"


def plain_text(text: str, *, style: str = "") -> Text:
    """Return a text from outside with terminal control characters escaped."""
    return Text("".join(c if c.isprintable() else repr(c)[1:-1] for c in text), style=style)


def plain_lines(text: str) -> Text:
    """Return the same of several lines."""
    return Text("\n").join(map(plain_text, text.split("\n")))


def _finding(finding: Finding) -> list[RenderableType]:
    """Return a finding: its place in one line, and a description below."""
    name = finding.severity.name
    where = Text.assemble((name.lower().replace("_", " "), SEVERITY_STYLES[name]), "  ")
    where.append_text(plain_text(finding.path.name))
    if finding.offset is not None:
        where.append(f", byte {finding.offset}")
    if finding.events is not None:
        lost = " lost" if name == "DAMAGE" else ""
        where.append(f", {events_text(finding.events)}{lost}")
    return [where, Padding(plain_text(finding.text), (0, 0, 0, 8), expand=False)]


def _what_to_do(found: Verification) -> str:
    if verdict(found) == "not as signed":
        return (
            "To do: where only signatures are missing, `sign` makes them. Else find out who had\n"
            "access to the log, and compare it with a copy from elsewhere."
        )
    if found.exit_code == 6:
        return "To do: find out who has written these events; then sign them."
    if found.exit_code == 4 and isinstance(found.path, UrlPath):
        return (
            "To do: remove the objects named above and manifest.json there, and ship the log\n"
            "again from its robot's disk or a backup; what is good there is not sent again:\n"
            f"  {command_line('ship', 'LOG', found.path)}"
        )
    if found.exit_code == 4:
        return (
            "To do: take the folder from a backup if there is one. What can be saved shows:\n"
            f"  {command_line('recover', found.path)}"
        )
    if found.exit_code == 3:
        return (
            "To do: nothing. The next writer keeps the torn tail in a file of its own and "
            "continues; if one is at work now, this is a commit that is being written."
        )
    return ""


def recovery_report(found: RecoveryPlan, done: Recovered | None) -> RenderableType:
    """Return what a recovery saves and loses, and where the files are afterwards.

    Args:
        found: The findings.
        done: What was done about it; None: nothing, this was only a check.
    """
    name = plain_text(str(found.path))
    if not found.has_to_do:
        said = Text.assemble(name, ": nothing to recover")
        if found.verification.of(Severity.TORN):
            said.append("; it has a torn tail, which the next writer puts in order")
        if done and done.kept:
            said.append(f"; a recovery that was interrupted is finished, see {done.kept}")
        return said
    tz = found.info.timezone if found.info else "UTC"
    saved = f"{counted(found.events, 'event')} in {counted(found.commits, 'commit')}"
    parts: list[RenderableType] = [
        Text.assemble(name, f": {'saved' if done else 'would be saved'} {saved}")
    ]
    if found.span_ns:
        first, last = (format_local(ns, tz) for ns in found.span_ns)
        parts.append(Text(f"recorded {first} to {last}"))
    for loss in found.losses:
        parts += _loss(loss, tz)
    if not found.losses:
        parts.append(Text("no event is lost"))
    if found.doors:
        doors = ", ".join(map(str, found.doors))
        parts.append(Text(f"doors that have events, but are not added any more: {doors}"))
    if found.dropped:
        numbers = ", ".join(map(str, found.dropped))
        parts.append(Text(f"dropped, since they retract lost events only: {numbers}"))
    if not found.keeps_numbers:
        parts.append(Text("after the first gap, events get new numbers; the log gets a new id"))
    parts += _where(done) if done else [Text("Nothing was written. To do it: add --yes.")]
    return Group(*parts)


def _loss(loss: Loss, tz: str) -> list[RenderableType]:
    span = [
        f"{word} {format_local(ns, tz)}"
        for word, ns in (("after", loss.after_ns), ("before", loss.before_ns))
        if ns is not None
    ]
    events = events_text((loss.first_event, loss.last_event))
    head = Text.assemble(("lost", "red"), f"  {events}, recorded {' and '.join(span)}".rstrip())
    why = [
        Padding(plain_text(f"{', '.join(loss.files)}: {text}"), (0, 0, 0, 6), expand=False)
        for text in loss.why
    ]
    return [head, *why]


def _where(done: Recovered) -> list[RenderableType]:
    said: list[RenderableType] = [plain_text(f"whole again: {done.log}")]
    if done.kept:
        said.append(plain_text(f"the damaged files: {done.kept}"))
    return said
