"""What many logs answered, and how far a run is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.fleet.jobs.job import Job, schema_of_job
from semmap_log.fleet.jobs.log_answer import LogAnswer
from semmap_log.fleet.jobs.log_outcome import AskedLog


@dataclass(frozen=True, slots=True)
class FleetProgress:
    """How far a run is."""

    done: int
    """Logs, good or bad."""
    logs: int
    events: int
    """Of the logs that answered in this run."""
    bytes: int
    """Of their segments, read or not."""


@dataclass(frozen=True, slots=True)
class FleetAnswer:
    """What many logs answered."""

    logs: tuple[AskedLog, ...]
    """What became of each, in the order in which they were asked."""
    table: pa.Table
    """The answers of those that gave one, in the same order; `log` is the place of each row's."""

    @property
    def bad(self) -> tuple[AskedLog, ...]:
        """The logs that gave no answer, or whose bytes are not as they were written."""
        return tuple(log for log in self.logs if not log.outcome.is_good)


@dataclass(frozen=True, slots=True)
class FoldAnswer(FleetAnswer):
    """What a projection makes of many logs."""

    states: dict[str, Any]
    """Log -> its state."""


Tell = Callable[[FleetProgress], None]


def joined_answers(job: Job, answers: Sequence[LogAnswer]) -> FleetAnswer:
    """Return the answers of many logs as one, in the same order."""
    tables = [each.table for each in answers if each.table is not None]
    table = pa.concat_tables([schema_of_job(job).empty_table(), *tables])
    return FleetAnswer(tuple(each.asked for each in answers), table)
