"""Doors that were there before the log says so: told again with an earlier time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded
from semmap_log.core.model.keywords import knows_keywords
from semmap_log.core.model.moments import format_local
from semmap_log.interop.importing.import_plan import Imported, ImportPlan
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.door_log_writer import DoorLogWriter


@knows_keywords
def backdate(
    log: DoorLogWriter, since_ns: int, *, note: Note = Note(), command_id: bytes | None = None
) -> Imported:
    """Say that doors of which something is told before they were added were there by then.

    Args:
        log: The log.
        since_ns: From when on they are there.
        note: Who and why.
        command_id: 16 bytes: the same command, sent again, is stored once.
    """
    plan = backdating(log, log.early_events().counts, since_ns)
    if plan.count == 0:
        return Imported(plan, None)
    appended = log.append(plan.events, note=note, command_id=command_id)
    return Imported(plan, appended.commit.last_event - plan.count + 1)


def with_backdated(log: DoorLog, plan: ImportPlan, since_ns: int) -> ImportPlan:
    """Return a plan, and before it that the doors which are there were there by an earlier time."""
    earlier = backdating(log, plan.there, since_ns)
    return replace(
        plan,
        events=[*earlier.events, *plan.events],
        count=earlier.count + plan.count,
        summary=(*plan.summary, *earlier.summary) if earlier.count else plan.summary,
    )


def backdating(log: DoorLog, doors: Collection[DoorId], since_ns: int) -> ImportPlan:
    """Return what says that doors of the log were there by an earlier time."""
    events = log.backdated(doors, since_ns)
    moved = sum(isinstance(event, DoorAdded) for event in events)
    since = format_local(since_ns, log.info.timezone)
    said = (f"doors: {moved} that the log has, there since {since}",) if moved else ()
    return ImportPlan(events, len(events), summary=said)
