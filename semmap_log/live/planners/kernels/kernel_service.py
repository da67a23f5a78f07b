"""Serves OPRS kernels by way of their message passer, and finds it again when it has gone."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from semmap_log.core.model.doors import DoorMap
from semmap_log.errors import PasserError, SemmapError
from semmap_log.live.planners.actions import AskedDoors
from semmap_log.live.planners.addresses import TcpAddress
from semmap_log.live.planners.kernels.kernel_questions import KernelQuestions
from semmap_log.live.planners.kernels.kernel_session import KernelSession, Patience
from semmap_log.live.planners.kernels.message_passer import CONNECT_S, PasserConnection
from semmap_log.live.planners.kernels.passer_frames import MOST_NAME_BYTES, check_own_name, is_name
from semmap_log.live.planners.kernels.s_expressions import is_atom
from semmap_log.live.planners.oracle import Oracle

FIRST_PAUSE_S = 0.2
LONGEST_PAUSE_S = 5.0
LASTING_S = 5.0
"""A connection that has lasted so long was a good one: the next try comes soon."""


@dataclass(frozen=True, slots=True)
class Kernels:
    """Where kernels are found, and who is told of the doors."""

    passer: TcpAddress
    name: str
    """Ours."""
    told: Sequence[str] = ()
    connect_s: float = CONNECT_S
    patience: Patience = field(default_factory=Patience)

    @property
    def where(self) -> str:
        """Where the message passer listens."""
        return str(self.passer).removeprefix("tcp:")

    def __post_init__(self) -> None:
        """Refuse names that cannot be.

        Raises:
            PasserError: One of them.
        """
        check_own_name(self.name)
        for kernel in self.told:
            if not (is_atom(kernel) and is_name(kernel)) or kernel == self.name:
                raise PasserError(
                    f"{kernel!r} cannot be the name of a kernel: expected at most "
                    f"{MOST_NAME_BYTES} letters, digits, _ and -, a letter first, and another "
                    "name than ours."
                )


class KernelService:
    """Tells kernels of the doors, and answers them, until it is closed."""

    def __init__(
        self,
        oracle: Oracle,
        doors: AskedDoors,
        kernels: Kernels,
        *,
        say: Callable[[str], object] = lambda _: None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """Begin; from then on somebody has to call `wake` after each change of the doors.

        Args:
            oracle: Knows the answers.
            doors: What kernels are told of.
            kernels: Who, and where.
            say: Is told when the passer comes and goes, and of what cannot be understood.
            clock_ns: Tells which action comes again soon.
        """
        self._doors = doors
        self._kernels = kernels
        self._say = say
        self._questions = KernelQuestions(oracle, doors, say=say, clock_ns=clock_ns)
        self._session: KernelSession | None = None
        self._said = ""
        """What went wrong last: it is told once."""
        self._has_changed = threading.Event()
        self._ending = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="oprs", daemon=True)
        self._thread.start()

    @property
    def failure(self) -> Exception | None:
        """Why no kernel is told anything any more; None: they are."""
        return self._failure

    def wake(self) -> None:
        """Hear that the doors have changed."""
        self._has_changed.set()
        if (session := self._session) is not None:
            session.wake()

    def close(self) -> None:
        """Leave the passer; what was begun is finished."""
        self._ending.set()
        self.wake()
        self._thread.join()
        self._questions.close()

    def _run(self) -> None:
        try:
            self._serve()
        except Exception as error:  # noqa: BLE001  whoever runs the service must hear of it
            self._failure = error
            if not isinstance(error, SemmapError):
                self._say(traceback.format_exc())

    def _serve(self) -> None:
        """Serve over one connection after the other."""
        pause_s = FIRST_PAUSE_S
        while not self._ending.is_set():
            began_s = time.monotonic()
            try:
                self._serve_once()
            except PasserError as error:
                if str(error) != self._said:
                    self._said = str(error)
                    self._say(f"OPRS: {error} It is tried again.")
            if time.monotonic() - began_s > self._kernels.connect_s + LASTING_S:
                pause_s = FIRST_PAUSE_S
            self._ending.wait(pause_s)
            pause_s = min(2 * pause_s, LONGEST_PAUSE_S)

    def _serve_once(self) -> None:
        """Serve as long as the passer is there."""
        kernels = self._kernels
        connection = PasserConnection(kernels.passer, kernels.name, timeout_s=kernels.connect_s)
        self._say(f"OPRS: {kernels.name} is registered at the message passer.")
        self._said = ""
        session = KernelSession(connection, kernels.name, kernels.told, self._questions,
                                say=lambda text: self._say(f"OPRS: {text}"),
                                patience=kernels.patience)  # fmt: skip
        self._session = session
        self._has_changed.set()
        try:
            session.run(self._ending.is_set, self._changed)
        finally:
            self._session = None
            session.close()

    def _changed(self) -> DoorMap | None:
        """Return the doors where they may be others than the last time."""
        if not self._has_changed.is_set():
            return None
        self._has_changed.clear()  # before looking: what comes now is looked at again
        return self._doors.door_map()
