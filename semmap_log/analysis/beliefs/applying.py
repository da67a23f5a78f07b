"""Write beliefs into the map as the thesis's `open_prob` and `closed_prob`.

The updates set no state, and are themselves no evidence: beliefs are the same afterwards.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from semmap_log.analysis.beliefs.door_beliefs import DoorBelief, probabilities
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Note, content_of
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.events import DoorUpdated
from semmap_log.core.model.meaning import Changed
from semmap_log.core.model.moments import Time, format_local
from semmap_log.core.texts import counted
from semmap_log.log import Appended, DoorLogWriter

DIGITS = 6
"""Digits of the probabilities: a smaller change does not count."""


@dataclass(frozen=True, slots=True)
class Applied:
    """What became of it."""

    beliefs: list[DoorBelief]
    """Of all doors queried."""
    written: list[DoorBelief]
    """Doors whose numbers changed; they are in the log now."""
    unknown: list[DoorBelief]
    """Doors of which too little is known; they are unchanged."""
    appended: Appended | None
    """None: nothing changed, and nothing was written."""


def apply_probabilities(
    log: DoorLogWriter,
    *,
    at: Time = None,
    known_at: Time = None,
    as_happened: bool = False,
    horizon_ns: int = 0,
    estimator: str | None = None,
    tz: str | None = None,
    doors: Iterable[DoorId | str] | None = None,
    note: Note = Note(),
    command_id: bytes | None = None,
    expected_event: int | None = None,
    progress: Progress | None = None,
) -> Applied:
    """Append P(open) and P(closed) of all doors that are known and differ, as one commit.

    They hold from the queried moment on. Repeated without new evidence, it writes nothing.

    Args:
        log: The log to query, and to write to.
        at: As `probabilities`.
        known_at: As `probabilities`.
        as_happened: As `probabilities`.
        horizon_ns: As `probabilities`.
        estimator: As `probabilities`.
        tz: As `probabilities`.
        doors: As `probabilities`.
        note: Who and why; the default source and reason name estimator, moment and evidence.
        command_id: 16 bytes: the same command, sent again, is stored once.
        expected_event: Number of the last event of the log, as the caller knows it.
        progress: Called with the progress of reading.

    Raises:
        CommandReusedError: Another command is already stored under this id.
        UnexpectedEventError: The log has more events since.
        SemmapError: As `probabilities`.
    """
    asked = list(doors) if doors is not None else None
    words = (at, horizon_ns, estimator, tz, asked, note)
    then = [] if known_at is None else [known_at]
    content = content_of("probabilities", *words, *then, *(["as happened"] * as_happened))
    beliefs = probabilities(
        log, at=at, known_at=known_at, as_happened=as_happened, horizon_ns=horizon_ns,
        estimator=estimator, tz=tz, doors=asked, progress=progress,
    )  # fmt: skip
    known = [belief for belief in beliefs if belief.is_known]
    unknown = [belief for belief in beliefs if not belief.is_known]
    if command_id is not None and log.find_command(command_id) is not None:
        stored = log.append([], command_id=command_id, content=content)
        return Applied(beliefs, [], unknown, stored)
    there = log.replay(at=beliefs[0].known_ns).doors if beliefs else {}
    now = log.replay().doors
    written = [
        belief
        for belief in known
        if belief.door.door_id in now and _differs(belief, there.get(belief.door.door_id))
    ]
    if not written:
        return Applied(beliefs, [], unknown, None)
    appended = log.append(
        [_update(belief) for belief in written],
        note=_told(note, written, log.info.timezone if tz is None else tz),
        command_id=command_id,
        content=content,
        expected_event=expected_event,
    )
    return Applied(beliefs, written, unknown, appended)


def _numbers(belief: DoorBelief) -> tuple[float, float]:
    """Return P(open) and P(closed) as they are written; their sum is 1."""
    p_open = round(belief.p_open, DIGITS)
    return p_open, round(1.0 - p_open, DIGITS)


def _differs(belief: DoorBelief, door: Door | None) -> bool:
    return door is None or _numbers(belief) != (door.prob_open, door.prob_closed)


def _update(belief: DoorBelief) -> DoorUpdated:
    p_open, p_closed = _numbers(belief)
    return DoorUpdated(
        door_id=belief.door.door_id,
        changed=Changed.PROB_OPEN | Changed.PROB_CLOSED,
        prob_open=p_open,
        prob_closed=p_closed,
        happened_ns=belief.known_ns,
    )


def _told(note: Note, written: list[DoorBelief], tz: str) -> Note:
    """Return the note with what the numbers are from, where the caller gave nothing else."""
    first = written[0]
    days = sum(belief.evidence.coverage.days for belief in written) / len(written)
    sightings = sum(belief.evidence.counts.sightings for belief in written)
    reason = (
        f"P(open) at {format_local(first.time_ns, tz)} by {first.estimator}, as known at "
        f"{format_local(first.known_ns, tz)}: {counted(len(written), 'door')}, "
        f"{counted(sightings, 'sighting')}, {days:.1f} days seen of each"
    )
    return replace(
        note,
        source=note.source or f"probabilities ({first.estimator})",
        reason=note.reason or reason,
    )
