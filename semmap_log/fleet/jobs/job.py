"""What a job is: one question, answered by one log with a table; equal columns for all logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, Protocol, runtime_checkable

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.io.disk import utf8_text
from semmap_log.fleet.jobs.log_outcome import AskedLog, LogOutcome
from semmap_log.log.door_log.door_log import DoorLog

LOG_FIELDS = (
    pa.field("log", pa.string(), nullable=False),
    pa.field("log_id", pa.string(), nullable=False),
    pa.field("robot", pa.string(), nullable=False),
    pa.field("building", pa.string(), nullable=False),
)
"""The first columns of every table: which log a row is of."""

TIME = pa.timestamp("ns", "UTC")


class Holds(Enum):
    """For how long an answer is one."""

    with_head = "as long as the log has the same head"
    within_a_run = "until a run has come to its end: it is about the bytes themselves"
    never = "it is not an answer alone: something is made"


@dataclass(frozen=True, slots=True)
class Told:
    """What a log answered."""

    rows: dict[str, list[Any]]
    """Column -> values, without those of `LOG_FIELDS`."""
    outcome: LogOutcome = LogOutcome.ok
    """Of a job that looks for damage."""
    file: str = ""
    byte: int | None = None
    text: str = ""


class Job(Protocol):
    """A question. It goes to workers as a pickle."""

    name: ClassVar[str]
    """As the command line says it."""
    fields: ClassVar[tuple[pa.Field, ...]]
    """The columns of its tables, behind `LOG_FIELDS`."""
    holds: ClassVar[Holds]
    """For how long a log's answer need not be asked again."""

    def parameters(self) -> str:
        """Return all that decides on the answer, beside the log."""

    def ask(self, log: DoorLog) -> Told:
        """Return a log's answer."""


@runtime_checkable
class PartedJob(Protocol):
    """A job that may be done in parts of a log, by as many workers as there are."""

    def parts(self, events: int) -> int:
        """Return in how many parts a log of so many events is asked; 1: whole."""

    def ask_part(self, log: DoorLog, part: int, parts: int, last_event: int) -> Any:
        """Return the answer of one part.

        Args:
            log: The log.
            part: 0 to `parts` - 1.
            parts: How many there are.
            last_event: Nothing behind it counts, so that all parts are of one moment.
        """

    def joined(self, answers: Sequence[Any]) -> Told:
        """Return the answer of the whole log, of those of its parts in order."""


def schema_of_job(job: Job) -> pa.Schema:
    """Return the schema of a job's tables."""
    return pa.schema([*LOG_FIELDS, *job.fields])


def table_of_log(job: Job, asked: AskedLog, told: Told) -> pa.Table:
    """Return a log's answer as a table of the job's schema."""
    schema = schema_of_job(job)
    rows = len(next(iter(told.rows.values()), []))
    whose = (asked.place, asked.log_id, asked.robot, asked.building)
    names = (field.name for field in LOG_FIELDS)
    columns = {name: [text] * rows for name, text in zip(names, whose, strict=True)} | told.rows
    return pa.Table.from_arrays(
        [_array(columns[field.name], field.type) for field in schema], schema=schema
    )


def _array(values: Sequence[Any], of: pa.DataType) -> pa.Array:
    """Return a column; of texts that name files, only UTF-8."""
    try:
        return pa.array(values, of)
    except UnicodeEncodeError:
        return pa.array([v if v is None else utf8_text(v) for v in values], of)
