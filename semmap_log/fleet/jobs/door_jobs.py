"""The jobs of a fleet run, its kept answers, and how logs are handed to an engine.

Jobs on doors: the map of a moment, openings by hour, how likely doors are open. Jobs on logs: what
each contains, and whether it is as it was written. Small logs go to an engine a few at a time,
since it takes milliseconds to hand one out; long ones in parts.

Answers are kept, so that an interrupted run continues and a repeated one is short. They lie where
`answer_places` says. Each answer is one checked file: a line of JSON, and a table in Arrow's stream
format.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from semmap_log.analysis.beliefs.door_beliefs import default_estimator, probabilities
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.folds.door_index import all_door_labels
from semmap_log.core.folds.timeline import Timeline, timelines
from semmap_log.core.io.checked_file import read_checked, write_checked
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import HOUR_NS
from semmap_log.errors import EngineError, OutputError
from semmap_log.fleet.answer_places import SUFFIX, answer_name, digits_of
from semmap_log.fleet.jobs.dask_engine import DaskEngine
from semmap_log.fleet.jobs.engine import TIMEOUT_S, Engine, NoAnswer, SerialEngine, WorkerDied
from semmap_log.fleet.jobs.job import (
    TIME,
    Holds,
    Job,
    LogAnswer,
    LogOutcome,
    LogQuestion,
    QueriedLog,
    Told,
    answers,
    joined_answer,
)
from semmap_log.log import DoorLog, Scope, Severity, verify

PART_EVENTS = 1_000_000
"""Events of a log in memory at once: some 60 bytes each while they are sorted."""

DOOR_FIELDS = (
    pa.field("door_id", pa.uint32(), nullable=False),
    pa.field("door", pa.string(), nullable=False),
)


@dataclass(frozen=True, slots=True)
class DoorMapJob:
    """All doors of all logs at a moment."""

    at: str | int | None = None
    known_at: str | int | None = None

    name: ClassVar[str] = "map"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (
        *DOOR_FIELDS,
        pa.field("level", pa.uint16(), nullable=False),
        *(pa.field(name, pa.float64()) for name in ("x", "y", "theta", "width")),
        pa.field("state", pa.string(), nullable=False),
        pa.field("last_seen", TIME),
        pa.field("prob_open", pa.float64()),
        pa.field("prob_closed", pa.float64()),
    )

    def parameters(self) -> str:
        """Return the moment."""
        return f"at={self.at!r} known_at={self.known_at!r}"

    def ask(self, log: DoorLog) -> Told:
        """Return a row a door, ids ascending."""
        doors = list(log.replay(self.at, self.known_at).doors.values())
        rows: dict[str, list[Any]] = {
            "door": [door.label for door in doors],
            "state": [door.state.name for door in doors],
            "last_seen": [door.last_seen_ns for door in doors],
        }
        for name in ("x", "y", "theta", "width", "prob_open", "prob_closed"):
            values = (getattr(door, name) for door in doors)
            rows[name] = [None if math.isnan(value) else value for value in values]
        for name in ("door_id", "level"):
            rows[name] = [getattr(door, name) for door in doors]
        return Told(rows)


@dataclass(frozen=True, slots=True)
class OpeningsJob:
    """How often each door was opened in each hour (UTC) in which it was.

    An opening is the beginning of an interval of a door's timeline in which it is OPEN, where it
    was last known to be CLOSED. So it is a lower bound: openings that no sensor saw do not count.
    """

    name: ClassVar[str] = "openings"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (
        *DOOR_FIELDS,
        pa.field("hour", TIME, nullable=False),
        pa.field("openings", pa.int64(), nullable=False),
    )

    def parameters(self) -> str:
        """Return the parameters: there are none."""
        return ""

    def ask(self, log: DoorLog) -> Told:
        """Return a row a door and hour."""
        return self.ask_part(log, 0, 1, log.last_event())

    def parts(self, events: int) -> int:
        """Return in how many parts the doors are queried separately."""
        return max(1, -(-events // PART_EVENTS))

    def ask_part(self, log: DoorLog, part: int, parts: int, last_event: int) -> Told:
        """Return the rows of the doors whose number modulo `parts` is `part`."""
        scope = Scope(event=None if last_event < 0 else last_event)
        labels = all_door_labels(log.state_in(scope))
        doors = [door for door in labels if door % parts == part] if parts > 1 else None
        found = timelines(log.visible_batches(scope), doors)
        rows: dict[str, list[Any]] = {"door_id": [], "door": [], "hour": [], "openings": []}
        for door_id, timeline in found.items():
            hours, counts = np.unique(openings_ns(timeline) // HOUR_NS, return_counts=True)
            rows["door_id"] += [door_id] * len(hours)
            rows["door"] += [labels.get(door_id, f"door {door_id}")] * len(hours)
            rows["hour"] += (hours * HOUR_NS).tolist()
            rows["openings"] += counts.tolist()
        return Told(rows)

    def joined(self, answers: Sequence[Told]) -> Told:
        """Return the rows of all doors, ids ascending."""
        rows = {name: [v for told in answers for v in told.rows[name]] for name in answers[0].rows}
        order = sorted(
            range(len(rows["hour"])), key=lambda i: (rows["door_id"][i], rows["hour"][i])
        )
        return Told({name: [values[i] for i in order] for name, values in rows.items()})


def openings_ns(timeline: Timeline) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return when a door was opened, nanoseconds UTC: it is OPEN, and was last known CLOSED."""
    known = np.isin(timeline.state, (DoorState.OPEN, DoorState.CLOSED))
    states, start_ns = timeline.state[known], timeline.start_ns[known]
    opens = np.flatnonzero((states[1:] == DoorState.OPEN) & (states[:-1] == DoorState.CLOSED)) + 1
    found: np.ndarray[Any, np.dtype[np.int64]] = start_ns[opens]
    return found


@dataclass(frozen=True, slots=True)
class ProbabilitiesJob:
    """How likely each door of each log is open: see `beliefs.door_beliefs.probabilities`."""

    at: str | int | None = None
    known_at: str | int | None = None
    horizon_ns: int = 0
    estimator: str | None = None

    name: ClassVar[str] = "probabilities"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (
        *DOOR_FIELDS,
        pa.field("time", TIME, nullable=False),
        *(pa.field(name, pa.float64(), nullable=False) for name in ("p_open", "low", "high")),
        pa.field("is_known", pa.bool_(), nullable=False),
        pa.field("estimator", pa.string(), nullable=False),
    )

    def parameters(self) -> str:
        """Return the moment, the horizon and the estimator."""
        name = self.estimator or default_estimator(self.horizon_ns)
        return f"at={self.at!r} known_at={self.known_at!r} {self.horizon_ns} {name}"

    def ask(self, log: DoorLog) -> Told:
        """Return a row a door, ids ascending."""
        found = probabilities(
            log, at=self.at, known_at=self.known_at, horizon_ns=self.horizon_ns,
            estimator=self.estimator,
        )  # fmt: skip
        rows: dict[str, list[Any]] = {
            "door_id": [belief.door.door_id for belief in found],
            "door": [belief.door.label for belief in found],
            "time": [belief.time_ns for belief in found],
        }
        for name in ("p_open", "low", "high", "is_known", "estimator"):
            rows[name] = [getattr(belief, name) for belief in found]
        return Told(rows)


def _counts(*names: str) -> tuple[pa.Field, ...]:
    return tuple(pa.field(name, pa.int64(), nullable=False) for name in names)


@dataclass(frozen=True, slots=True)
class InfoJob:
    """What each log contains, as `info` reports it for one."""

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
        """Return the parameters: there are none."""
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
        """Return the parameters: there are none."""
        return ""

    def ask(self, log: DoorLog) -> Told:
        """Return one row, and the worst finding."""
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


FORMAT = 1
MOST_BYTES = 2**28
"""Of an answer; a longer one is not kept."""


class KeptAnswers:
    """The answers to one question."""

    def __init__(self, folder: Path, job: Job) -> None:
        """List the answers that are there.

        Raises:
            OutputError: The folder cannot be made.
        """
        ours = f"{FORMAT} {version('semmap-log')} {[str(field) for field in job.fields]}"
        asked = f"{ours} {job.name} {job.parameters()}"
        self.folder = folder / f"{job.name}-{digits_of(asked)}"
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)  # who was where
        except OSError as error:
            raise OutputError(
                f"{folder}: answers cannot be kept there: {error.strerror}; name another folder "
                "with --results."
            ) from None
        self._holds = job.holds
        self._files = {path.name.split("-", 1)[0]: path for path in self.folder.glob(f"*{SUFFIX}")}

    def of(self, places: Iterable[str]) -> dict[str, LogAnswer]:
        """Return the complete answers that are there for these logs."""
        found = ((place, self.get(place)) for place in places)
        return {place: kept for place, kept in found if kept is not None}

    def get(self, place: str) -> LogAnswer | None:
        """Return the answer of a log; None: there is no complete one."""
        path = self._files.get(digits_of(place))
        if path is None:
            return None
        data = read_checked(path, MOST_BYTES)
        if data is None:
            return None
        try:
            line, _, table = data.partition(b"\n")
            told = json.loads(line)
            if told["place"] != place:
                return None
            asked = QueriedLog(**{**told, "outcome": LogOutcome(told["outcome"])})
            return LogAnswer(replace(asked, is_kept=True), pa.ipc.open_stream(table).read_all())
        except (ValueError, TypeError, KeyError, pa.ArrowException):
            return None

    def keep(self, answer: LogAnswer) -> None:
        """Keep an answer, which replaces the log's last one.

        If that fails, or the answer is too long, the next run queries the log again.
        """
        assert answer.table is not None
        asked = answer.asked
        out = pa.BufferOutputStream()
        with pa.ipc.new_stream(out, answer.table.schema) as writer:
            writer.write_table(answer.table)
        body = json.dumps(asdict(asked)).encode() + b"\n" + out.getvalue().to_pybytes()
        if len(body) > MOST_BYTES:
            return
        of = digits_of(asked.place)
        path = self.folder / answer_name(asked.place, asked.log_id, asked.head)
        before = self._files.get(of)
        with suppress(OSError):
            write_checked(path, body)
            self._files[of] = path
            if before not in (None, path):
                before.unlink(missing_ok=True)

    def finish(self) -> None:
        """Mark the end of a run: answers that hold for one run only are dropped."""
        if self._holds is Holds.within_a_run:
            for path in self._files.values():
                with suppress(OSError):
                    path.unlink(missing_ok=True)
            self._files.clear()


ENGINES = ("dask", "serial")
WORKER_MEMORY = "1GiB"


@dataclass(frozen=True, slots=True)
class EngineChoice:
    """Which engine to use, and how large."""

    name: str = "dask"
    """One of `ENGINES`."""
    scheduler: str = ""
    """Address of a running cluster; empty: one of this machine is started, and ended."""
    workers: int | None = None
    """Workers of a cluster that is started; default: one a core."""
    memory: str = WORKER_MEMORY
    """Memory limit of each such worker; beyond it the worker is ended, its question given up."""
    timeout_s: float = TIMEOUT_S
    """If no worker answers for so long, the remaining logs are given up."""

    def open(self) -> Engine:
        """Start the engine, or join the cluster.

        Raises:
            EngineError: There is no such engine, or nobody answers at the address.
            MissingExtraError: Its package is not installed.
        """
        workers = self.workers or len(os.sched_getaffinity(0))
        if self.name == "serial":
            return SerialEngine()
        if self.name == "dask":
            return DaskEngine(self.scheduler, workers, self.memory, self.timeout_s)
        raise EngineError(f"engine {self.name!r}: expected one of {', '.join(ENGINES)}.")


BATCHES, MOST_IN_A_BATCH = 50, 16


def ask_logs(engine: Engine, job: Job, questions: Sequence[LogQuestion]) -> Iterator[LogAnswer]:
    """Yield the answer of each log, those of long ones last.

    Raises:
        EngineError: The engine has gone.
    """
    long: list[tuple[QueriedLog, int]] = []
    late: list[QueriedLog] = []
    for _, found in _asked(engine, job, questions):
        if found.parts:
            long.append((found.asked, found.parts))
            continue
        if found.asked.outcome is LogOutcome.no_answer:
            late.append(found.asked)
        yield found
    if late:  # nobody answers any more
        yield from (_given_up(asked, late[0]) for asked, _ in long)
    else:
        yield from _in_parts(engine, job, long)


def _in_parts(
    engine: Engine, job: Job, long: Sequence[tuple[QueriedLog, int]]
) -> Iterator[LogAnswer]:
    """Yield the answers of logs that are queried in parts; `long` holds (log, number of parts)."""
    parts = [
        LogQuestion(asked.place, part=n, parts=count, last_event=asked.events - 1)
        for asked, count in long
        for n in range(count)
    ]
    whole = {asked.place: asked for asked, _ in long}
    got: dict[str, dict[int, Any]] = {place: {} for place in whole}
    bad: dict[str, LogAnswer] = {}
    for part, found in _asked(engine, job, parts):
        if not found.asked.outcome.is_good:
            bad.setdefault(part.place, found)
            continue
        here = got[part.place]
        here[part.part] = found.part
        if len(here) == part.parts:
            yield joined_answer(job, whole[part.place], [here[n] for n in range(part.parts)])
            del got[part.place]
    yield from bad.values()


def _asked(
    engine: Engine, job: Job, questions: Sequence[LogQuestion]
) -> Iterator[tuple[LogQuestion, LogAnswer]]:
    """Yield what workers answer.

    When a worker dies, each log that a worker then had is queried once more, alone: only this shows
    which one is to blame. Once no worker answers in time, none is waited for again.
    """
    size = min(max(len(questions) // BATCHES, 1), MOST_IN_A_BATCH)
    batches = [questions[at : at + size] for at in range(0, len(questions), size)]
    suspects: list[LogQuestion] = []
    late: NoAnswer | None = None
    for number, found in engine.run(answers, job, batches):
        if isinstance(found, WorkerDied):
            suspects += batches[number]
        elif isinstance(found, NoAnswer):
            late = found
            yield from ((each, _late(each, found)) for each in batches[number])
        else:
            yield from zip(batches[number], found, strict=True)
    for suspect in suspects:
        if late is None:
            ((_, found),) = engine.run(answers, job, [[suspect]])
            late = found if isinstance(found, NoAnswer) else None
        if late is not None:
            yield suspect, _late(suspect, late)
        else:
            yield suspect, _died(suspect) if isinstance(found, WorkerDied) else found[0]


def _late(question: LogQuestion, late: NoAnswer) -> LogAnswer:
    text = (
        f"no worker has answered for {late.within_s:g} s: one has died, or needs longer. Finished "
        "answers are kept; run again with a longer --timeout, or with --engine serial"
    )
    return LogAnswer(QueriedLog(question.place, LogOutcome.no_answer, text=text))


def _given_up(asked: QueriedLog, late: QueriedLog) -> LogAnswer:
    """Return the answer of a long log whose parts are skipped, since another log was late."""
    return LogAnswer(replace(asked, outcome=late.outcome, text=late.text))


def _died(question: LogQuestion) -> LogAnswer:
    text = (
        "each worker that was given it was ended, by its memory or by a crash; ask it alone: "
        "--engine serial"
    )
    return LogAnswer(QueriedLog(question.place, LogOutcome.worker_died, text=text))
