"""Logs handed to an engine, and their answers as they come.

Small logs are asked a few at a time, since an engine takes milliseconds to hand one out; long ones
in parts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from semmap_log.fleet.jobs.engine import Engine, NoAnswer, WorkerDied
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
    late: list[AskedLog] = []
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
    which it was. Once no worker answers in time, none is waited for again.
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
        f"no worker has answered for {late.within_s:g} s: one has gone, or needs longer. What was "
        "answered is kept; run it again with a longer --timeout, or ask it alone: --engine serial"
    )
    return LogAnswer(AskedLog(question.place, LogOutcome.no_answer, text=text))


def _given_up(asked: AskedLog, late: AskedLog) -> LogAnswer:
    """Return the answer of a long log whose parts are not asked, since another log was late."""
    return LogAnswer(replace(asked, outcome=late.outcome, text=late.text))


def _died(question: LogQuestion) -> LogAnswer:
    text = (
        "each worker that was given it was ended, by its memory or by a crash; ask it alone: "
        "--engine serial"
    )
    return LogAnswer(AskedLog(question.place, LogOutcome.worker_died, text=text))
