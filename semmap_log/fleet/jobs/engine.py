"""Where functions run: here, one after the other, or on what others have built.

An engine is one function: it takes questions and yields answers, in any order, each once. What
holds for all of them: a worker that dies takes nothing along but the question that killed it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from semmap_log.errors import EngineError

ENGINES = ("dask", "ray", "serial")
DEATHS = 3
"""A question that has killed more workers than that is given up."""
WORKER_MEMORY = "1GiB"


class WorkerDied:
    """In the place of an answer: each worker that was given the question was ended."""


@dataclass(frozen=True, slots=True)
class EngineChoice:
    """Which engine, and how much of it."""

    name: str = "dask"
    """One of `ENGINES`."""
    scheduler: str = ""
    """Address of a cluster that runs; empty: one of this machine is started, and ended."""
    workers: int | None = None
    """Of a cluster that is started; None: as many as there are cores."""
    memory: str = WORKER_MEMORY
    """Of each such worker at most; beyond, it is ended, and its question is given up."""

    def open(self) -> Engine:
        """Start it, or join the cluster.

        Raises:
            EngineError: There is no such engine, or nobody answers at the address.
            MissingExtraError: Its package is not installed.
        """
        workers = self.workers or len(os.sched_getaffinity(0))
        if self.name == "serial":
            return SerialEngine()
        if self.name == "dask":
            from semmap_log.fleet.jobs.dask_engine import DaskEngine

            return DaskEngine(self.scheduler, workers, self.memory)
        if self.name == "ray":
            from semmap_log.fleet.jobs.ray_engine import RayEngine

            return RayEngine(self.scheduler, workers)
        raise EngineError(f"engine {self.name!r}: expected one of {', '.join(ENGINES)}.")


class Engine(Protocol):
    """What runs functions."""

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, questions: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield (number of a question, `function(shared, question)` or `WorkerDied`).

        Args:
            function: Of a module that workers have, too.
            shared: Its first argument.
            questions: The second ones.

        Raises:
            EngineError: The engine itself has gone.
        """

    def close(self) -> None:
        """End what was started."""


class SerialEngine:
    """This process."""

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, questions: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield answers in order."""
        for number, question in enumerate(questions):
            yield number, function(shared, question)

    def close(self) -> None:
        """End nothing."""
