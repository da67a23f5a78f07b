"""One log asked by one job: what a worker does. What goes wrong with a log is an answer, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.io.url_path import place_of
from semmap_log.errors import (
    CorruptLogError,
    LogAccessError,
    MomentError,
    NewerLogError,
    NotALogError,
    SemmapError,
)
from semmap_log.fleet.jobs.job import Job, PartedJob, table_of_log
from semmap_log.fleet.jobs.log_outcome import AskedLog, LogOutcome
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.store.reading.reader import LogReader


@dataclass(frozen=True, slots=True)
class LogQuestion:
    """What a worker gets."""

    place: str
    known_head: str = ""
    """Of the log, when it answered before: with the same one it need not answer again."""
    part: int = 0
    parts: int = 0
    """0: the whole log, or it is told that it is asked in parts."""
    last_event: int = -1
    """Of a part: nothing behind it counts."""


@dataclass(frozen=True, slots=True)
class LogAnswer:
    """What a worker gives back."""

    asked: AskedLog
    table: pa.Table | None = None
    """None: there is none."""
    parts: int = 0
    """More than 0: the log is long, and wants to be asked in so many parts."""
    part: Any = None
    """The answer of a part."""
    is_question_wrong: bool = False
    """The moment asked for is none to it: perhaps to no log, perhaps in its time zone only."""


def answers(job: Job, questions: Sequence[LogQuestion]) -> list[LogAnswer]:
    """Return the answers of several logs, in order, or what became of them.

    Nothing is raised that one log alone can cause.
    """
    return [_answer(job, question) for question in questions]


def joined_answer(job: Job, asked: AskedLog, parts: Sequence[Any]) -> LogAnswer:
    """Return the answer of a log whose parts have answered.

    Args:
        job: The job.
        asked: The log, as it was before it was asked in parts.
        parts: Their answers, in order.
    """
    assert isinstance(job, PartedJob)
    try:
        return LogAnswer(asked, table_of_log(job, asked, job.joined(parts)))
    except Exception as error:  # noqa: BLE001  a projection of a user's may raise anything
        return LogAnswer(_without(asked, error))


def _answer(job: Job, question: LogQuestion) -> LogAnswer:
    asked = AskedLog(question.place, LogOutcome.ok)
    try:
        reader = LogReader(place_of(question.place))
        asked = _described(asked, reader)
        return _answered(job, question, reader, asked)
    except Exception as error:  # noqa: BLE001  as above
        is_wrong = isinstance(error, MomentError)
        return LogAnswer(_without(asked, error), is_question_wrong=is_wrong)


def _answered(job: Job, question: LogQuestion, reader: LogReader, asked: AskedLog) -> LogAnswer:
    log = DoorLog(reader)
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


def _described(asked: AskedLog, reader: LogReader) -> AskedLog:
    """Return what is known of a log that was opened."""
    last, segments, info = reader.last_commit(), reader.segments, reader.info
    return replace(
        asked,
        outcome=LogOutcome.ok if segments[-1].closed else LogOutcome.live,
        log_id=info.log_id,
        robot=info.robot,
        building=info.building,
        head="" if last is None else last.hash.hex(),
        events=0 if last is None else last.last_event + 1,
        bytes=sum(segment.size for segment in segments),
    )


_OUTCOMES: tuple[tuple[type[Exception], LogOutcome], ...] = (
    (CorruptLogError, LogOutcome.damaged),
    (NewerLogError, LogOutcome.newer),
    (NotALogError, LogOutcome.gone),
    (LogAccessError, LogOutcome.refused),
)


def _without(asked: AskedLog, error: Exception) -> AskedLog:
    """Return what became of a log that gave no answer."""
    found = next((kind for cls, kind in _OUTCOMES if isinstance(error, cls)), LogOutcome.failed)
    why = error.__cause__ or error.__context__
    if found is LogOutcome.refused and isinstance(why, FileNotFoundError):
        found = LogOutcome.gone
    text = str(error) if isinstance(error, SemmapError) else f"{type(error).__name__}: {error}"
    file, byte = "", None
    if isinstance(error, CorruptLogError):
        file, byte = error.path.name, error.offset
    return replace(asked, outcome=found, text=text, file=file, byte=byte)
