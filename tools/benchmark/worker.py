"""Peers in child processes, taking turns: A B A B, so that a busy machine is busy for all alike."""

from __future__ import annotations

import gc
import os
import signal
import time
import traceback
from collections.abc import Callable, Iterable
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
        for counts in (*[False] * case.warms_up, *[True] * case.rounds):
            for child in children:
                child.take_turns(case.burst, case.burst_s, counts=counts)
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
        self._process = context.Process(
            target=_serve, args=(theirs, peer.prepare, peer.cores), daemon=True
        )
        self._process.start()
        theirs.close()
        self._seconds: list[float] = []
        self._cpu_seconds: list[float] = []
        self._read_bytes: list[int] = []
        self._missing = ""

    def take_turns(self, count: int, limit_s: float, *, counts: bool) -> None:
        """Let it do its task so often, or for so long; keep the times if they count."""
        said = self._ask((count, limit_s))
        if counts and said:
            self._seconds += said[0]
            self._cpu_seconds += said[1]
            self._read_bytes += said[2]

    def finish(self) -> Measured:
        """Return its figures, its answer compared."""
        said = self._ask(None)
        if self._missing:
            return Measured(self._peer, problem=self._missing)
        peak_bytes, answer, note = said
        agrees = bool(answer == self._peer.expected)
        return Measured(
            self._peer,
            tuple(self._seconds),
            peak_bytes,
            agrees,
            cpu_seconds=tuple(self._cpu_seconds),
            read_bytes=tuple(self._read_bytes),
            note=note,
        )

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

    def _ask(self, turns: tuple[int, float] | None) -> Any:
        if self._missing:
            return None
        with suppress(ConnectionError):  # it may have died after saying why
            self._pipe.send(turns)
        return self.await_answer()


def _serve(pipe: Connection, prepare: Callable[[], Work], cores: int | None) -> None:
    """Do what the parent asks for, until it has the answer; runs in the child."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends us when it is interrupted
    try:
        _stay_on(cores)
        work = prepare()
        read_so_far = work.read_bytes or _read_bytes
        _forget_peak()
        pipe.send(("ready", None))
        result = None
        while (asked := pipe.recv()) is not None:
            turns, limit_s = asked
            seconds: list[float] = []
            cpu_seconds: list[float] = []
            read_bytes: list[int] = []
            while len(seconds) < turns and sum(seconds) < limit_s:
                result = None  # two results at a time are not the task's memory
                given = next(work.inputs)
                before = (read_so_far(), time.process_time())
                start = time.perf_counter()
                result = work.once(given)
                seconds.append(time.perf_counter() - start)
                cpu_seconds.append(time.process_time() - before[1])
                read_bytes.append(read_so_far() - before[0])
            pipe.send(("turns", (seconds, cpu_seconds, read_bytes)))
        peak_bytes = _peak_bytes()
        pipe.send(("answer", (peak_bytes, work.answer(result), work.note(result))))
    except (EOFError, ConnectionError):
        return  # the parent has gone
    except ModuleNotFoundError as error:
        pipe.send(("missing", error.name))
    except Exception:  # noqa: BLE001 - the parent raises it
        pipe.send(("failed", traceback.format_exc()))


def _stay_on(cores: int | None) -> None:
    """Hold this process, and the threads it will start, on so many cores.

    Raises:
        ModuleNotFoundError: There are not so many: what is missing is said, and nothing fails.
    """
    if cores is None:
        return
    here = sorted(os.sched_getaffinity(0))
    if len(here) < cores:
        raise ModuleNotFoundError(name=f"{cores} cores")
    os.sched_setaffinity(0, here[:cores])


def _read_bytes() -> int:
    """Return what this process had the disk read so far, by calls or by touching mapped pages."""
    with suppress(OSError):
        lines = Path("/proc/self/io").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("read_bytes:"))
    return 0


def drop_from_memory(files: Iterable[Path]) -> None:
    """Have the kernel forget what it holds of these files, as far as nobody has them mapped."""
    gc.collect()  # what was opened before and is not needed any more is unmapped
    for path in files:
        fd = os.open(path, os.O_RDONLY)
        try:
            os.fdatasync(fd)  # what is not on the disk yet cannot be forgotten
            os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_DONTNEED)
        finally:
            os.close(fd)


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
