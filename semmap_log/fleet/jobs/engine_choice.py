"""Which engine asks the logs, and how much of it."""

from __future__ import annotations

import os
from dataclasses import dataclass

from semmap_log.errors import EngineError
from semmap_log.fleet.jobs.dask_engine import DaskEngine
from semmap_log.fleet.jobs.engine import TIMEOUT_S, Engine, SerialEngine
from semmap_log.fleet.jobs.ray_engine import RayEngine

ENGINES = ("dask", "ray", "serial")
WORKER_MEMORY = "1GiB"


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
    timeout_s: float = TIMEOUT_S
    """Where no worker answers for so long, the logs that are left are given up."""

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
            return DaskEngine(self.scheduler, workers, self.memory, self.timeout_s)
        if self.name == "ray":
            return RayEngine(self.scheduler, workers, self.timeout_s)
        raise EngineError(f"engine {self.name!r}: expected one of {', '.join(ENGINES)}.")
