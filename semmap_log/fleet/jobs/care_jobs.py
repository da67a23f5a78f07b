"""Jobs that look after logs: what each holds, and whether it is as it was written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.fleet.jobs.job import TIME, Holds, Told
from semmap_log.fleet.jobs.log_outcome import LogOutcome
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.replay.care import verify
from semmap_log.store.verification import Severity


def _counts(*names: str) -> tuple[pa.Field, ...]:
    return tuple(pa.field(name, pa.int64(), nullable=False) for name in names)


@dataclass(frozen=True, slots=True)
class InfoJob:
    """What each log holds, as `info` says it of one."""

    name: ClassVar[str] = "info"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (
        *_counts("doors", "events", "commits", "segments", "bytes"),
        pa.field("first", TIME),
        pa.field("last", TIME),
        pa.field("timezone", pa.string(), nullable=False),
        pa.field("head", pa.string(), nullable=False),
        *_counts("warnings"),
    )

    def parameters(self) -> str:
        """Return that there are none."""
        return ""

    def ask(self, log: DoorLog) -> Told:
        """Return one row."""
        found = log.summary()
        first, last = found.happened_ns or (None, None)
        return Told(
            {
                "doors": [len(found.door_map.doors)],
                "events": [found.events],
                "commits": [found.commits],
                "segments": [len(found.segments)],
                "bytes": [found.bytes],
                "first": [first],
                "last": [last],
                "timezone": [found.info.timezone],
                "head": [found.head.hex()],
                "warnings": [len(found.warnings)],
            }
        )


@dataclass(frozen=True, slots=True)
class VerifyJob:
    """Whether each log is as it was written: every byte of each is read."""

    name: ClassVar[str] = "verify"
    holds: ClassVar[Holds] = Holds.within_a_run
    fields: ClassVar[tuple[pa.Field, ...]] = (
        pa.field("exit_code", pa.int8(), nullable=False),
        *_counts("segments", "commits", "events", "bytes", "findings"),
        pa.field("head", pa.string(), nullable=False),
        pa.field("finding", pa.string(), nullable=False),
    )

    def parameters(self) -> str:
        """Return that there are none."""
        return ""

    def ask(self, log: DoorLog) -> Told:
        """Return one row, and the worst that was found."""
        found = verify(log.path)
        told = [each for each in found.findings if each.severity is not Severity.NOTE]
        worst = told[0] if told else None
        rows: dict[str, list[Any]] = {
            "exit_code": [found.exit_code],
            "segments": [found.segments],
            "commits": [found.commits],
            "events": [found.events],
            "bytes": [found.size],
            "findings": [len(told)],
            "head": [found.head.hex()],
            "finding": ["" if worst is None else worst.text],
        }
        if worst is None or found.exit_code in (0, 3):
            return Told(rows, LogOutcome.live if found.exit_code else LogOutcome.ok)
        return Told(rows, LogOutcome.damaged, worst.path.name, worst.offset, worst.text)
