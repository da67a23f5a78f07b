"""Query many logs at once.

import semmap_log as sl

found = sl.fleet(["s3://hospital/logs"]).map(at="2026-03-02T10:30")
found.table         # a pyarrow.Table: a row a door, with the log that it is of
found.logs          # what became of each log
found.bad           # those without an answer
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from semmap_log.core.folds.projection import Projection
from semmap_log.core.io.url_path import place_of
from semmap_log.errors import MomentError
from semmap_log.fleet.answer_places import default_folder
from semmap_log.fleet.jobs import door_jobs
from semmap_log.fleet.jobs.engine import TIMEOUT_S, Engine
from semmap_log.fleet.jobs.job import (
    FleetAnswer,
    FleetProgress,
    FoldAnswer,
    FoldJob,
    Holds,
    Job,
    LogAnswer,
    LogQuestion,
    Tell,
    joined_answers,
)
from semmap_log.fleet.jobs.lake_folder import lake_files, remove_earlier_files
from semmap_log.fleet.jobs.log_places import MonthExport, log_places

if TYPE_CHECKING:
    from typing_extensions import Self


class Fleet:
    """Many logs, and the engine that queries them.

    Each query starts and ends an engine; inside `with` one engine serves them all.
    """

    def __init__(
        self, places: Sequence[str], choice: door_jobs.EngineChoice, results: Path, *, fresh: bool
    ) -> None:
        self.places = tuple(places)
        """Their paths and URLs."""
        self._choice = choice
        self._results = results
        self._fresh = fresh
        self._engine: Engine | None = None

    def __enter__(self) -> Self:
        """Start the engine, or join its cluster, for all queries in the block."""
        self._engine = self._choice.open()
        return self

    def __exit__(self, *_: object) -> None:
        """End what was started."""
        if self._engine is not None:
            self._engine.close()
            self._engine = None

    @contextmanager
    def _open_engine(self) -> Iterator[Engine]:
        if self._engine is not None:
            yield self._engine
            return
        with self as opened:
            assert opened._engine is not None
            yield opened._engine

    def map(
        self, at: str | int | None = None, known_at: str | int | None = None, *,
        progress: Tell | None = None,
    ) -> FleetAnswer:  # fmt: skip
        """Return all doors of all logs at a moment, in each building's own time.

        Args:
            at: The moment, with all that is known today; None: each log's end.
            known_at: Only what had been recorded by then, whole commits.
            progress: Called with the progress of the run.

        Raises:
            MomentError: A time cannot be read, by any log.
            EngineError: The engine is missing, or has gone; answers so far are kept.
        """
        return self.ask(door_jobs.DoorMapJob(at, known_at), progress=progress)

    def openings(self, *, progress: Tell | None = None) -> FleetAnswer:
        """Return how often each door was opened, by hour (UTC); see `OpeningsJob`."""
        return self.ask(door_jobs.OpeningsJob(), progress=progress)

    def probabilities(
        self, at: str | int | None = None, known_at: str | int | None = None, *,
        horizon_ns: int = 0, estimator: str | None = None, progress: Tell | None = None,
    ) -> FleetAnswer:  # fmt: skip
        """Return how likely each door is open; see `beliefs.door_beliefs.probabilities`."""
        job = door_jobs.ProbabilitiesJob(at, known_at, horizon_ns, estimator)
        return self.ask(job, progress=progress)

    def verify(self, *, progress: Tell | None = None) -> FleetAnswer:
        """Read every byte of each log, as `verify` does of one, and return a row for each."""
        return self.ask(door_jobs.VerifyJob(), progress=progress)

    def info(self, *, progress: Tell | None = None) -> FleetAnswer:
        """Return what each log contains, a row each."""
        return self.ask(door_jobs.InfoJob(), progress=progress)

    def export(self, out: str | Path, *, progress: Tell | None = None) -> FleetAnswer:
        """Write every event of each log as Parquet files, a folder a month; see `month_export`.

        Args:
            out: A folder that each worker sees, or a URL.
            progress: Called with the progress of the run.
        """
        place = place_of(out)
        lake = str(place.absolute() if isinstance(place, Path) else place)  # of any worker's folder
        found = self.ask(MonthExport(lake), progress=progress)
        remove_earlier_files(lake, lake_files(found.table))
        return found

    def fold(self, projection: Projection[Any], *, progress: Tell | None = None) -> FoldAnswer:
        """Return the state that a projection makes of each log.

        Args:
            projection: From a module that the workers have, too. If it has `merge`, long logs are
                folded in parts. Its `name` and `version` decide whether an answer of an earlier
                run is still valid.
            progress: Called with the progress of the run.
        """
        job = FoldJob(projection)
        found = self.ask(job, progress=progress)
        rows = zip(*(found.table[name].to_pylist() for name in ("log", "state")), strict=True)
        states = {place: job.load(state) for place, state in rows}
        return FoldAnswer(found.logs, found.table, states)

    def ask(self, job: Job, *, progress: Tell | None = None) -> FleetAnswer:
        """Return the answers to a question: see `job`."""
        kept = None if job.holds is Holds.never else door_jobs.KeptAnswers(self._results, job)
        had = {} if kept is None or self._fresh else kept.of(self.places)
        answers: dict[str, LogAnswer] = {}
        done = FleetProgress(0, len(self.places), 0, 0)
        with self._open_engine() as engine:
            questions = [
                LogQuestion(place, had[place].asked.head if place in had else "")
                for place in self.places
            ]
            for found in door_jobs.ask_logs(engine, job, questions):
                asked = found.asked
                table = had[asked.place].table if asked.is_kept else found.table
                if kept is not None and asked.outcome.is_good and not asked.is_kept:
                    kept.keep(found)
                answers[asked.place] = replace(found, table=table)
                is_new = not asked.is_kept
                done = FleetProgress(
                    len(answers), done.logs,
                    done.events + asked.events * is_new, done.bytes + asked.bytes * is_new,
                )  # fmt: skip
                if progress is not None:
                    progress(done)
        if all(each.is_question_wrong for each in answers.values()):
            raise MomentError(answers[self.places[0]].asked.text)
        if kept is not None:
            kept.finish()
        return joined_answers(job, [answers[place] for place in self.places])


def fleet(
    urls: str | PurePath | Iterable[str | PurePath],
    *,
    engine: str = "dask",
    scheduler: str = "",
    workers: int | None = None,
    memory: str = door_jobs.WORKER_MEMORY,
    timeout_s: float = TIMEOUT_S,
    results: str | Path | None = None,
    fresh: bool = False,
) -> Fleet:
    """Return many logs, to query them at once.

    Workers are processes that import the program: a script calls this below
    `if __name__ == "__main__":`.

    Args:
        urls: Logs, folders or prefixes with logs right below them, patterns with `*`, or `@FILE`
            with one such a line.
        engine: `dask`, or `serial`: one log after the other, in this process.
        scheduler: Address of a running cluster; empty: workers of this machine.
        workers: Number of workers of this machine; default: one a core.
        memory: Memory limit of each of them.
        timeout_s: If no worker answers for so long, the remaining logs have no answer.
        results: A folder where answers are kept; default: among the user's caches.
        fresh: Query each log, even if its answer is kept.

    Raises:
        NotALogError: `urls` name no log.
        MissingExtraError: A package is not installed.
    """
    places = log_places([urls] if isinstance(urls, str | PurePath) else urls)
    folder = default_folder() if results is None else Path(results)
    choice = door_jobs.EngineChoice(engine, scheduler, workers, memory, timeout_s)
    return Fleet(places, choice, folder, fresh=fresh)
