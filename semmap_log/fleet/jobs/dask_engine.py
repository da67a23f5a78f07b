"""Dask distributed: a cluster that runs, or processes of this machine."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from importlib import import_module
from queue import Empty, Queue
from typing import Any
from uuid import uuid4

from semmap_log.errors import EngineError, MissingExtraError
from semmap_log.fleet.jobs.engine import DEATHS, NoAnswer, WorkerDied

ANSWERS_WITHIN_S = 20
_NEVER = "10000 days"
"""How long a killed worker of this machine may take to restart. On a busy machine it takes
minutes; without this, Dask gives the worker up for good after 15 s."""
_EXPECTED = "expected an address such as tcp://10.0.0.5:8786, which `dask scheduler` prints."


class DaskEngine:
    """A client of a scheduler."""

    def __init__(self, scheduler: str, workers: int, memory: str, timeout_s: float) -> None:
        """Join a cluster, or start one; as `EngineChoice.open`."""
        try:
            import dask

            distributed: Any = import_module("distributed")
        except ImportError as error:
            raise MissingExtraError("distributed", "fleet") from error
        self._distributed = distributed
        self._cluster: Any = None
        self._timeout_s = timeout_s
        dask.config.set(
            {
                "distributed.scheduler.allowed-failures": DEATHS,
                "distributed.deploy.lost-worker-timeout": _NEVER,
                "distributed.comm.timeouts.connect": f"{ANSWERS_WITHIN_S}s",
            }
        )
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # outcomes report the same
        if scheduler and ":" not in scheduler:
            raise EngineError(f"no Dask scheduler at {scheduler}: {_EXPECTED}")
        try:
            if not scheduler:
                self._cluster = distributed.LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    memory_limit=memory,
                    dashboard_address="127.0.0.1:0",
                    preload=["semmap_log.fleet.jobs.dask_worker"],
                    silence_logs=logging.CRITICAL,
                )
            self._client: Any = distributed.Client(
                self._cluster or scheduler, timeout=ANSWERS_WITHIN_S, set_as_default=False
            )
        except (OSError, ValueError, TimeoutError, asyncio.TimeoutError) as error:
            self._end_cluster()
            where = scheduler or "this machine"
            raise EngineError(
                f"no Dask scheduler at {where}: {error or 'it does not answer'}; {_EXPECTED}"
            ) from None

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, questions: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield answers as they come; as `Engine.run`."""
        name = f"semmap-{uuid4().hex}"
        numbers = {
            self._client.submit(
                function, shared, question, key=f"{name}-{number}", pure=False
            ): number
            for number, question in enumerate(questions)
        }
        done: Queue[Any] = Queue()
        for future in numbers:
            future.add_done_callback(done.put)
        while numbers:
            try:
                future = done.get(timeout=self._timeout_s)
            except Empty:
                yield from ((number, NoAnswer(self._timeout_s)) for number in numbers.values())
                return
            yield numbers.pop(future), self._result(future)
            future.release()

    def _result(self, future: Any) -> Any:
        """Return a future's result; it is computed again where its worker has gone with it.

        Raises:
            EngineError: There is none, and it is not the question's fault.
        """
        end_s = time.monotonic() + self._timeout_s
        try:
            return future.result(timeout=self._timeout_s)
        except self._distributed.scheduler.KilledWorker:
            return WorkerDied()
        except (TimeoutError, asyncio.TimeoutError) as error:
            if time.monotonic() >= end_s:
                return NoAnswer(self._timeout_s)
            raise _gone(error) from None
        except (CancelledError, asyncio.CancelledError, OSError) as error:
            raise _gone(error) from None
        except Exception as error:
            raise EngineError(
                f"a worker could not run the question: {type(error).__name__}: {error}. Workers "
                "need the same semmap-log, and the module of a --fold."
            ) from error

    def close(self) -> None:
        """Leave the cluster; end the one that was started."""
        self._client.close()
        self._end_cluster()

    def _end_cluster(self) -> None:
        if self._cluster is not None:
            self._cluster.close()


def _gone(error: BaseException) -> EngineError:
    return EngineError(
        f"the Dask scheduler has gone ({type(error).__name__}). Finished answers are kept; "
        "run the command again to continue."
    )
