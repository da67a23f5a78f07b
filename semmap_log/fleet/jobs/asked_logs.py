"""Logs handed to an engine, and their answers as they come.

Small logs are asked a few at a time, since an engine takes milliseconds to hand one out; long ones
in parts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from semmap_log.fleet.jobs.engine import Engine, WorkerDied
from semmap_log.fleet.jobs.job import Job
from semmap_log.fleet.jobs.log_answer import LogAnswer, LogQuestion, answers, joined_answer
from semmap_log.fleet.jobs.log_outcome import AskedLog, LogOutcome

BATCHES, MOST_IN_A_BATCH = 50, 16


def ask_logs(engine: Engine, job: Job, questions: Sequence[LogQuestion]) -> Iterator[LogAnswer]:
    """Yield the answer of each log, those of long ones last.

    Raises:
        EngineError: The engine has gone.
    """
    long: list[tuple[AskedLog, int]] = []
    for _, found in _asked(engine, job, questions):
        if found.parts:
            long.append((found.asked, found.parts))
        else:
            yield found
    yield from _in_parts(engine, job, long)


def _in_parts(
    engine: Engine, job: Job, long: Sequence[tuple[AskedLog, int]]
) -> Iterator[LogAnswer]:
    """Yield the answers of logs that are asked in parts: asked log, and how many parts."""
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

    What was with a worker whenever one died is asked once more, each alone: only so it is known
    which it was.
    """
    size = min(max(len(questions) // BATCHES, 1), MOST_IN_A_BATCH)
    batches = [questions[at : at + size] for at in range(0, len(questions), size)]
    suspects: list[LogQuestion] = []
    for number, found in engine.run(answers, job, batches):
        if isinstance(found, WorkerDied):
            suspects += batches[number]
        else:
            yield from zip(batches[number], found, strict=True)
    for suspect in suspects:
        for _, found in engine.run(answers, job, [[suspect]]):
            yield suspect, _died(suspect) if isinstance(found, WorkerDied) else found[0]


def _died(question: LogQuestion) -> LogAnswer:
    text = (
        "each worker that was given it was ended, by its memory or by a crash; ask it alone: "
        "--engine serial"
    )
    return LogAnswer(AskedLog(question.place, LogOutcome.worker_died, text=text))
