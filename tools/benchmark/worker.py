"""Peers in child processes, taking turns: A B A B, so that a busy machine is busy for all alike."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from benchmark.case import Case, Measured, Peer, Work


class PeerFailedError(Exception):
    """A peer's process met an error of its own; the text is its traceback."""


def measure(case: Case) -> list[Measured]:
    """Return what came out for each peer of a case, in their order.

    Raises:
        PeerFailedError: One of them failed (one that is not installed only says so).
    """
    children = [_Child(peer) for peer in case.peers]
    try:
        for child in children:
            child.await_answer()  # prepared: from here on only one of them works at a time
        for counts in (False, *[True] * case.rounds):
            for child in children:
                child.take_turns(case.burst, counts=counts)
        return [child.finish() for child in children]
    finally:
        for child in children:
            child.stop()


class _Child:
    """A peer's process, as seen from ours."""

    def __init__(self, peer: Peer) -> None:
        context = get_context("spawn")  # a fork would begin with our memory
        self._peer = peer
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, peer.prepare), daemon=True)
        self._process.start()
        theirs.close()
        self._seconds: list[float] = []
        self._missing = ""

    def take_turns(self, count: int, *, counts: bool) -> None:
        """Let it do its task so often; keep the times if they count."""
        seconds = self._ask(count)
        if counts:
            self._seconds += seconds or []

    def finish(self) -> Measured:
        """Return its figures, its answer compared."""
        said = self._ask(0)
        if self._missing:
            return Measured(self._peer, problem=self._missing)
        peak_bytes, answer = said
        agrees = bool(answer == self._peer.expected)
        return Measured(self._peer, tuple(self._seconds), peak_bytes, agrees)

    def await_answer(self) -> Any:
        """Return what it says next.

        Raises:
            PeerFailedError: It met an error, or died.
        """
        try:
            kind, value = self._pipe.recv()
        except (EOFError, ConnectionError) as error:
            raise PeerFailedError(f"{self._peer.name}: its process died") from error
        if kind == "failed":
            raise PeerFailedError(f"{self._peer.name}:\n{value}")
        if kind == "missing":
            self._missing = f"needs {value}"
            return None
        return value

    def stop(self) -> None:
        """End the process, whatever it is doing."""
        self._pipe.close()
        self._process.join(timeout=1)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _ask(self, turns: int) -> Any:
        if self._missing:
            return None
        with suppress(ConnectionError):  # it may have died after saying why
            self._pipe.send(turns)
        return self.await_answer()


def _serve(pipe: Connection, prepare: Callable[[], Work]) -> None:
    """Do what the parent asks for, until it has the answer; runs in the child."""
    try:
        work = prepare()
        _forget_peak()
        pipe.send(("ready", None))
        result = None
        while turns := pipe.recv():
            seconds = []
            for _ in range(turns):
                given = next(work.inputs)
                result = None  # two results at a time are not the task's memory
                start = time.perf_counter()
                result = work.once(given)
                seconds.append(time.perf_counter() - start)
            pipe.send(("turns", seconds))
        peak_bytes = _peak_bytes()
        pipe.send(("answer", (peak_bytes, work.answer(result))))
    except (EOFError, ConnectionError):
        return  # the parent has gone
    except ModuleNotFoundError as error:
        pipe.send(("missing", error.name))
    except Exception:  # noqa: BLE001 - the parent raises it
        pipe.send(("failed", traceback.format_exc()))


def _forget_peak() -> None:
    """Begin to watch the memory: what preparing took is not the task's."""
    with suppress(OSError):  # then the figure holds the preparation, too: more, never less
        Path("/proc/self/clear_refs").write_text("5")


def _peak_bytes() -> int:
    """Return the most memory this process had at a time.

    Not `ru_maxrss`, which a process inherits from the one that started it.
    """
    status = Path("/proc/self/status").read_text()
    peak = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(peak.split()[1]) * 1024
