"""A log, and the service that tells kernels of its doors, in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import semmap_log as sl
from semmap_log.live.planners.addresses import TcpAddress
from semmap_log.live.planners.kernels.kernel_service import Kernels, KernelService, Patience
from semmap_log.live.planners.oracle import Oracle
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver


@dataclass
class KernelWorld:
    """What runs."""

    doors: DoorServer
    oracle: Oracle
    service: KernelService
    said: list[str]
    now_ns: list[int] = field(default_factory=lambda: [0])
    """The time by which an action comes again soon."""

    @property
    def log(self) -> Any:
        return self.doors.log

    def changed(self) -> None:
        """Tell of a change that a test has made on the log itself."""
        self.oracle.refresh()
        self.service.wake()


def make_log(path: Path) -> Path:
    """A log of three doors; the last has no name."""
    with sl.create(path, tz="UTC") as log:
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, state="open", name="main", prob_open=0.75)
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, state="closed", name='b "c"')
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, state="unknown")
    return path


@contextmanager
def serving_kernels(
    path: Path, port: int, *told: str, patience: Patience | None = None
) -> Iterator[KernelWorld]:
    """Serve kernels at a passer."""
    said: list[str] = []
    now_ns = [10**18]
    calls: list[Callable[[], object]] = []
    doors = DoorServer(
        lambda: sl.append(path), DoorSaver(None, path), changed=lambda: [each() for each in calls]
    )
    try:
        oracle = Oracle(doors, say=said.append)
        kernels = Kernels(
            TcpAddress("127.0.0.1", port), "SEMMAP", told, patience=patience or Patience()
        )
        service = KernelService(oracle, doors, kernels, say=said.append, clock_ns=lambda: now_ns[0])
        calls += [oracle.refresh, service.wake]
        try:
            yield KernelWorld(doors, oracle, service, said, now_ns)
        finally:
            service.close()
        assert service.failure is None, said
    finally:
        doors.close()
