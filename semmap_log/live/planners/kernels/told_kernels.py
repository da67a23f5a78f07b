"""Which kernels are there, and what each of them is told; no socket.

The passer tells nobody who comes or goes. It says `(unknown K1)` to who sends K1 something in
vain, and does all in order. So a kernel is sent `(DOOR_MAP SEMMAP)`, and we a message to ourselves:
once that is back, and nothing was said of the kernel, it is there, and is told all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from semmap_log.core.model.doors import DoorMap
from semmap_log.live.planners.kernels.door_facts import DoorFacts, Fact
from semmap_log.live.planners.kernels.passer_frames import message
from semmap_log.live.planners.kernels.s_expressions import Expression
from semmap_log.live.planners.question_lines import Atom

FIRST_PAUSE_S = 0.5
LONGEST_PAUSE_S = 5.0

ECHO = Atom("SEMMAP_ECHO")
"""First word of what we send to ourselves."""


@dataclass(slots=True)
class _Kernel:
    """One that is to be told of the doors."""

    is_present: bool = False
    echo: int | None = None
    """The message to ourselves after whose return it is there; None: it was not called."""
    next_call_s: float = 0.0
    pause_s: float = FIRST_PAUSE_S


class ToldKernels:
    """Tells kernels of the doors, over one connection."""

    def __init__(self, name: str, kernels: Iterable[str], put: Callable[[bytes], object]) -> None:
        """Know none of them to be there.

        Args:
            name: Ours.
            kernels: Who is to be told.
            put: Sends a frame.
        """
        self._name = name
        self._put = put
        self._facts = DoorFacts()
        self._kernels = {kernel: _Kernel() for kernel in kernels}
        self._echoes = 0

    def take(self, doors: DoorMap) -> None:
        """Tell what is new to all that are there."""
        news = self._facts.take(doors)
        present = [name for name, kernel in self._kernels.items() if kernel.is_present]
        if present:
            self._send(present, news)

    def call(self, now_s: float) -> None:
        """Call those that may be there by now."""
        called = False
        for name, kernel in self._kernels.items():
            if kernel.is_present or kernel.echo is not None or kernel.next_call_s > now_s:
                continue
            self._send([name], [(Atom("DOOR_MAP"), Atom(self._name))])
            kernel.echo = self._echoes + 1
            kernel.next_call_s = now_s + kernel.pause_s
            kernel.pause_s = min(2 * kernel.pause_s, LONGEST_PAUSE_S)
            called = True
        if called:
            self.echo()

    def echo(self) -> None:
        """Send ourselves a message."""
        self._echoes += 1
        self._send([self._name], [(ECHO, self._echoes)])

    def returned(self, echo: Expression) -> None:
        """Hear a message to ourselves: kernels that were called before it are there."""
        for name, kernel in self._kernels.items():
            if kernel.echo is not None and kernel.echo == echo:
                self.tell_all(name)

    def is_unknown(self, name: str, now_s: float) -> None:
        """Hear that a kernel is not there: it is called again later."""
        kernel = self._kernels.get(name)
        if kernel is not None:
            kernel.is_present, kernel.echo = False, None
            kernel.next_call_s = max(kernel.next_call_s, now_s + FIRST_PAUSE_S)

    def is_there(self, name: str) -> None:
        """Hear that a kernel has said something: it need not wait to be called."""
        kernel = self._kernels.get(name)
        if kernel is not None and not kernel.is_present:
            kernel.next_call_s = 0.0

    def tell_all(self, name: str) -> None:
        """Tell one that is there all facts, and that these were all."""
        if (kernel := self._kernels.get(name)) is not None:
            kernel.is_present, kernel.echo, kernel.pause_s = True, None, FIRST_PAUSE_S
        self._send([name], [*self._facts.all(), self._facts.complete(self._name)])

    @property
    def next_call_s(self) -> float | None:
        """When one is to be called; None: all are there."""
        absent = [
            kernel.next_call_s
            for kernel in self._kernels.values()
            if not kernel.is_present and kernel.echo is None
        ]
        return min(absent, default=None)

    def _send(self, names: Sequence[str], facts: Iterable[Fact]) -> None:
        for fact in facts:
            self._put(message(names, fact))
