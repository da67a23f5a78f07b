"""What a job is: one question that each log answers with a table, of equal columns for all logs.

A worker puts the question to one log; what goes wrong with a log is an answer, too. Every fleet's
answer has a row for each log with what became of it, and the progress of the run. `FoldJob` is the
job of a projection that a user has written: it returns the projection's state of each log.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from importlib import import_module
from typing import Any, ClassVar, Protocol, runtime_checkable

from semmap_log import errors
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.folds.plain_state import dump_plain, load_plain
from semmap_log.core.folds.projection import Dumping, Mergeable, Projection, name_of, version_of
from semmap_log.core.io.disk import utf8_text
from semmap_log.log import DoorLog


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

    logs: tuple[QueriedLog, ...]
    """What became of each log, in the order of the request."""
    table: pa.Table
    """The answers of those that gave one, in the same order; column `log` is the log's place."""

    @property
    def bad(self) -> tuple[QueriedLog, ...]:
        """The logs that gave no answer, or whose bytes are not as they were written."""
        return tuple(log for log in self.logs if not log.outcome.is_good)


@dataclass(frozen=True, slots=True)
class FoldAnswer(FleetAnswer):
    """A projection's states of many logs."""

    states: dict[str, Any]
    """Log -> its state."""


Tell = Callable[[FleetProgress], None]


def joined_answers(job: Job, answers: Sequence[LogAnswer]) -> FleetAnswer:
    """Return the answers of many logs as one, in the same order."""
    tables = [each.table for each in answers if each.table is not None]
    table = pa.concat_tables([schema_of_job(job).empty_table(), *tables])
    return FleetAnswer(tuple(each.asked for each in answers), table)


class LogOutcome(str, Enum):
    """How a log answered."""

    ok = "ok"
    live = "live"
    """It answered; somebody is writing to it, or it was not closed."""
    damaged = "damaged"
    gone = "gone"
    """There is no log, or none any more."""
    newer = "newer"
    """A later version of this program has written the requested data."""
    refused = "refused"
    """The store or the disk denies access, or does not answer."""
    failed = "failed"
    """The question itself failed on it."""
    worker_died = "worker died"
    """Each worker that was given it was ended: by its memory, or by a crash."""
    no_answer = "no answer"
    """No worker has answered for as long as the run waits: one has gone, or needs longer."""

    @property
    def is_good(self) -> bool:
        """Whether there is an answer."""
        return self in (LogOutcome.ok, LogOutcome.live)


@dataclass(frozen=True, slots=True)
class QueriedLog:
    """A log, and what became of it."""

    place: str
    """Its path or URL, as it was given."""
    outcome: LogOutcome
    log_id: str = ""
    robot: str = ""
    building: str = ""
    head: str = ""
    """Of the log as it answered: the hash of its last commit, in hexadecimal digits."""
    events: int = 0
    bytes: int = 0
    """Of its segments, read or not."""
    file: str = ""
    """Where the damage is."""
    byte: int | None = None
    text: str = ""
    """Why there is no answer."""
    is_kept: bool = False
    """An earlier run had its answer."""


LOG_FIELDS = (
    pa.field("log", pa.string(), nullable=False),
    pa.field("log_id", pa.string(), nullable=False),
    pa.field("robot", pa.string(), nullable=False),
    pa.field("building", pa.string(), nullable=False),
)
"""The first columns of every table: which log a row is of."""

TIME = pa.timestamp("ns", "UTC")


class Holds(Enum):
    """How long an answer is valid."""

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
    """The name on the command line."""
    fields: ClassVar[tuple[pa.Field, ...]]
    """The columns of its tables, after `LOG_FIELDS`."""
    holds: ClassVar[Holds]
    """How long a log's answer stays valid."""

    def parameters(self) -> str:
        """Return everything but the log that determines the answer."""

    def ask(self, log: DoorLog) -> Told:
        """Return a log's answer."""


@runtime_checkable
class PartedJob(Protocol):
    """A job that may be done in parts of a log, by as many workers as there are."""

    def parts(self, events: int) -> int:
        """Return in how many parts a log of `events` events is queried; 1: whole."""

    def ask_part(self, log: DoorLog, part: int, parts: int, last_event: int) -> Any:
        """Return the answer of one part.

        Args:
            log: The log.
            part: 0 to `parts` - 1.
            parts: How many there are.
            last_event: Later events do not count, so that all parts are of one moment.
        """

    def joined(self, answers: Sequence[Any]) -> Told:
        """Return the answer of the whole log from those of its parts, in order."""


def schema_of_job(job: Job) -> pa.Schema:
    """Return the schema of a job's tables."""
    return pa.schema([*LOG_FIELDS, *job.fields])


def table_of_log(job: Job, asked: QueriedLog, told: Told) -> pa.Table:
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
    """Return a column; texts that name files are made valid UTF-8."""
    try:
        return pa.array(values, of)
    except UnicodeEncodeError:
        return pa.array([v if v is None else utf8_text(v) for v in values], of)


PART_EVENTS = 500_000


@dataclass(frozen=True, slots=True)
class FoldJob:
    """A projection's state of each log: plain values and numpy arrays, or what it dumps itself."""

    projection: Projection[Any]

    name: ClassVar[str] = "fold"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (pa.field("state", pa.binary(), nullable=False),)

    def parameters(self) -> str:
        """Return the projection's name and version: see `Projection`."""
        cls = type(self.projection)
        return f"{cls.__module__}:{name_of(self.projection)} {version_of(self.projection)}"

    def ask(self, log: DoorLog) -> Told:
        """Return one row."""
        return Told({"state": [self.dump(log.fold(self.projection))]})

    def parts(self, events: int) -> int:
        """Return how many ranges of events are folded separately: one, if it cannot merge them."""
        can_merge = isinstance(self.projection, Mergeable)
        return max(1, -(-events // PART_EVENTS)) if can_merge else 1

    def ask_part(self, log: DoorLog, part: int, parts: int, last_event: int) -> bytes:
        """Return the state of one range of events."""
        first, behind = ((last_event + 1) * n // parts for n in (part, part + 1))
        state = log.fold_part(self.projection, first, behind - 1, known_event=last_event)
        return self.dump(state)

    def joined(self, answers: Sequence[bytes]) -> Told:
        """Return the state of all ranges, merged in their order."""
        assert isinstance(self.projection, Mergeable)
        state, *later = (self.load(answer) for answer in answers)
        for each in later:
            state = self.projection.merge(state, each)
        return Told({"state": [self.dump(state)]})

    def dump(self, state: Any) -> bytes:
        """Return a state as bytes.

        Raises:
            CheckpointError: It cannot be stored.
        """
        if isinstance(self.projection, Dumping):
            return self.projection.dump(state)
        return dump_plain(state)

    def load(self, data: bytes) -> Any:
        """Return the state of these bytes."""
        if isinstance(self.projection, Dumping):
            return self.projection.load(data)
        return load_plain(data)


def projection_of(target: str) -> Projection[Any]:
    """Return a projection of a name such as `openings:Openings`; modules of this folder, too.

    Raises:
        EngineError: There is none, or it is no projection.
    """
    module, colon, name = target.partition(":")
    if not (module and colon and name):
        raise errors.EngineError(
            f"--fold {target}: expected module:Class, such as openings:Openings."
        )
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        found = getattr(import_module(module), name)
        projection: Projection[Any] = found() if isinstance(found, type) else found
    except (ImportError, AttributeError, TypeError) as error:
        raise errors.EngineError(f"--fold {target}: cannot be had: {error}.") from None
    missing = [each for each in ("initial", "apply") if not callable(getattr(projection, each, 0))]
    if missing:
        raise errors.EngineError(
            f"--fold {target}: expected a projection, which has initial() and apply(state, batch); "
            f"got a {type(projection).__name__} without {' and '.join(missing)}."
        )
    return projection


@dataclass(frozen=True, slots=True)
class LogQuestion:
    """What a worker gets."""

    place: str
    known_head: str = ""
    """The head of the log at its earlier answer: if unchanged, it need not answer again."""
    part: int = 0
    parts: int = 0
    """0: query the whole log, or answer that it must be queried in parts."""
    last_event: int = -1
    """Of a part: later events do not count."""


@dataclass(frozen=True, slots=True)
class LogAnswer:
    """What a worker returns."""

    asked: QueriedLog
    table: pa.Table | None = None
    """None: there is none."""
    parts: int = 0
    """More than 0: the log is long, and must be queried in so many parts."""
    part: Any = None
    """The answer of a part."""
    is_question_wrong: bool = False
    """The requested moment does not exist for the log: in its time zone, or in any."""


def answers(job: Job, questions: Sequence[LogQuestion]) -> list[LogAnswer]:
    """Return the answers of several logs, in order, or what became of them.

    An error that one log causes is its answer, and is not raised.
    """
    return [_answer(job, question) for question in questions]


def joined_answer(job: Job, asked: QueriedLog, parts: Sequence[Any]) -> LogAnswer:
    """Return the answer of a log whose parts have answered.

    Args:
        job: The job.
        asked: The log, as it was before the query in parts.
        parts: Their answers, in order.
    """
    assert isinstance(job, PartedJob)
    try:
        return LogAnswer(asked, table_of_log(job, asked, job.joined(parts)))
    except Exception as error:  # noqa: BLE001  a projection of a user's may raise anything
        return LogAnswer(_without(asked, error))


def _answer(job: Job, question: LogQuestion) -> LogAnswer:
    asked = QueriedLog(question.place, LogOutcome.ok)
    try:
        log = DoorLog(question.place)
        asked = _described(asked, log)
        return _answered(job, question, log, asked)
    except Exception as error:  # noqa: BLE001  as above
        is_wrong = isinstance(error, errors.MomentError)
        return LogAnswer(_without(asked, error), is_question_wrong=is_wrong)


def _answered(job: Job, question: LogQuestion, log: DoorLog, asked: QueriedLog) -> LogAnswer:
    if question.parts:
        assert isinstance(job, PartedJob)
        part = job.ask_part(log, question.part, question.parts, question.last_event)
        return LogAnswer(asked, part=part)
    if asked.head and asked.head == question.known_head:
        return LogAnswer(replace(asked, is_kept=True))
    if isinstance(job, PartedJob) and (parts := job.parts(asked.events)) > 1:
        return LogAnswer(asked, parts=parts)
    told = job.ask(log)
    table = table_of_log(job, asked, told)
    if told.outcome is not LogOutcome.ok:
        asked = replace(asked, outcome=told.outcome, file=told.file, byte=told.byte, text=told.text)
    return LogAnswer(asked, table)


def _described(asked: QueriedLog, log: DoorLog) -> QueriedLog:
    """Return the description of an opened log."""
    last, info = log.find_commit(log.last_event()), log.info
    return replace(
        asked,
        outcome=LogOutcome.live if log.is_live() else LogOutcome.ok,
        log_id=info.log_id,
        robot=info.robot,
        building=info.building,
        head="" if last is None else last.hash.hex(),
        events=0 if last is None else last.last_event + 1,
        bytes=log.size(),
    )


_OUTCOMES: tuple[tuple[type[Exception], LogOutcome], ...] = (
    (errors.CorruptLogError, LogOutcome.damaged),
    (errors.NewerLogError, LogOutcome.newer),
    (errors.NotALogError, LogOutcome.gone),
    (errors.LogAccessError, LogOutcome.refused),
)


def _without(asked: QueriedLog, error: Exception) -> QueriedLog:
    """Return what became of a log that gave no answer."""
    found = next((kind for cls, kind in _OUTCOMES if isinstance(error, cls)), LogOutcome.failed)
    why = error.__cause__ or error.__context__
    if found is LogOutcome.refused and isinstance(why, FileNotFoundError):
        found = LogOutcome.gone
    text = (
        str(error) if isinstance(error, errors.SemmapError) else f"{type(error).__name__}: {error}"
    )
    file, byte = "", None
    if isinstance(error, errors.CorruptLogError):
        file, byte = error.path.name, error.offset
    return replace(asked, outcome=found, text=text, file=file, byte=byte)
