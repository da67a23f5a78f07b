"""Whom of planners `serve` answers, over a socket or a message passer: by one oracle."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from semmap_log.cli.asking import Asking, Now
from semmap_log.cli.common import say
from semmap_log.cli.oprs import kernels_served
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.live.planners.actions import AskedDoors
    from semmap_log.live.planners.kernels.kernel_service import Kernels

TICK_S = 0.1
"""How often a server without ROS looks whether it is to end."""


@dataclass(frozen=True, slots=True)
class Planners:
    """Who asks, and how."""

    asking: Asking | None
    """Over a socket."""
    kernels: Kernels | None
    """Over a message passer."""
    now: Now
    """What relative times count from."""

    @classmethod
    def of(cls, asking: Asking | None, kernels: Kernels | None, now: Now) -> Planners | None:
        """Return who asks; None: nobody.

        Raises:
            typer.BadParameter: A choice is about them, and there are none.
        """
        if asking is not None or kernels is not None:
            return cls(asking, kernels, now)
        if now != Now.clock:
            raise typer.BadParameter("only with --ask or --oprs", param_hint="--ask-now")
        return None

    @contextmanager
    def served(
        self, log: Path, doors: AskedDoors, changes: list[Callable[[], object]]
    ) -> Iterator[Callable[[], Exception | None]]:
        """Answer them within; gives what tells why they cannot be answered any more, if so.

        Args:
            log: For what is said.
            doors: What is asked about.
            changes: Called after each change of the doors.

        Raises:
            AddressError: Questions cannot be taken there.
        """
        from semmap_log.live.planners.oracle import Oracle

        clock_ns = time.time_ns if self.now == Now.clock else _no_clock
        oracle = Oracle(doors, say=say, clock_ns=clock_ns)
        changes.append(oracle.refresh)
        oracle.refresh()  # what has changed in between
        many = counted(len(doors.door_map()), "door")
        with ExitStack() as running:
            failures: list[Callable[[], Exception | None]] = [lambda: oracle.failure]
            if self.asking is not None:
                server = running.enter_context(self.asking.served(oracle))
                say(f"{log}: questions are taken at {server.address}: {many}.")
                failures.append(lambda: server.failure)
            if self.kernels is not None:
                say(f"{log}: kernels of OPRS are served by way of {self.kernels.where}: {many}.")
                service = running.enter_context(
                    kernels_served(self.kernels, oracle, doors, changes)
                )
                failures.append(lambda: service.failure)
            yield lambda: next((why for tell in failures if (why := tell()) is not None), None)


def _no_clock() -> int:
    """Return a time before any log's: then the log's end is what counts."""
    return 0
