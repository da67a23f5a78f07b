"""Ray: a cluster that runs, or processes of this machine."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any

from semmap_log.errors import EngineError
from semmap_log.fleet.jobs.engine import DEATHS, NoAnswer, WorkerDied

OBJECT_STORE_BYTES = 100 * 2**20


class RayEngine:
    """A driver of Ray's."""

    def __init__(self, scheduler: str, workers: int, timeout_s: float) -> None:
        """Join a cluster, or start one; as `EngineChoice.open`."""
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            ray: Any = import_module("ray")
        except ImportError:
            raise EngineError("ray is not installed; install it with: pip install ray") from None
        self._ray = ray
        self._timeout_s = timeout_s
        local = {
            "num_cpus": workers,
            "object_store_memory": OBJECT_STORE_BYTES,
            "include_dashboard": False,
        }
        try:
            ray.init(
                address=scheduler or "local",
                logging_level=logging.CRITICAL,
                log_to_driver=False,
                **({} if scheduler else local),
            )
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise EngineError(f"no Ray cluster at {scheduler or 'this machine'}: {error}") from None

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, questions: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield answers as they come; as `Engine.run`."""
        ray = self._ray
        remote = ray.remote(max_retries=DEATHS, num_cpus=1)(function)
        given = ray.put(shared)
        numbers = {remote.remote(given, each): n for n, each in enumerate(questions)}
        waiting = list(numbers)
        while waiting:
            ready, waiting = ray.wait(waiting, num_returns=1, timeout=self._timeout_s)
            if not ready:
                yield from ((numbers[each], NoAnswer(self._timeout_s)) for each in waiting)
                return
            yield numbers[ready[0]], self._result(ready[0])

    def _result(self, ready: Any) -> Any:
        exceptions = self._ray.exceptions
        try:
            return self._ray.get(ready, timeout=self._timeout_s)
        except exceptions.GetTimeoutError:
            return NoAnswer(self._timeout_s)
        except (exceptions.WorkerCrashedError, exceptions.OutOfMemoryError):
            return WorkerDied()
        except exceptions.RayError as error:
            raise EngineError(f"Ray could not run the question: {error}") from None

    def close(self) -> None:
        """Leave the cluster; end the one that was started."""
        self._ray.shutdown()
