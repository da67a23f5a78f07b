"""A kind of faults in a process of its own, with a share of the run's time."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import islice
from multiprocessing.connection import Connection
from typing import NoReturn

from fault_injection.fault import CannotTryError, Kind, Outcome, Plan


@dataclass(frozen=True, slots=True)
class Share:
    """The time of one kind, seconds of a clock."""

    clock: Callable[[], float]
    start: float
    end: float

    def left(self, now: float) -> float:
        """Return how much of it is left."""
        return self.end - now

    def is_over(self, now: float) -> bool:
        """Tell whether none is."""
        return now >= self.end


class Budget:
    """The time of a run: what a kind does not need, the others get."""

    def __init__(self, clock: Callable[[], float], seconds: float | None, kinds: int) -> None:
        """Start it; without `seconds` there is no end."""
        self.clock = clock
        self._end = math.inf if seconds is None else clock() + seconds
        self._to_come = kinds

    def next_share(self) -> Share:
        """Return the time of the next kind, from now on."""
        now = self.clock()
        share = (self._end - now) / self._to_come
        self._to_come -= 1
        return Share(self.clock, now, now + share)


AGAIN_S = 5.0
GRACE_S = 20.0
"""So long a kind may take to put away what it built (a mounted disk), before it is killed."""


class KindApart:
    """A kind at work, until it is closed."""

    def __init__(self, kind: Kind, plan: Plan) -> None:
        """Start it."""
        self._answers, inlet = multiprocessing.Pipe(duplex=False)
        self._pid = os.fork()
        if self._pid == 0:
            self._answers.close()
            _try(kind, plan, inlet)
        inlet.close()
        with suppress(OSError):  # it did so itself, or has ended
            os.setpgid(self._pid, self._pid)
        self._code: int | None = None

    def next(self, timeout_s: float) -> Outcome | None:
        """Return what became of the next fault; None: it is not known after so long.

        Raises:
            StopIteration: There is no further one.
            CannotTryError: It cannot be tried here.
        """
        was_running = self._is_running()
        try:
            if self._answers.poll(max(0.0, timeout_s)):
                answer = self._answers.recv()
            elif was_running:
                return None
            else:  # a process that it left behind keeps the pipe open
                raise StopIteration
        except EOFError:
            code, self._code = self._wait(), 0
            if code:
                return Outcome("the kind itself", problem=f"its process ended with code {code}")
            raise StopIteration from None
        if isinstance(answer, CannotTryError):
            raise answer
        assert isinstance(answer, Outcome)
        return answer

    def close(self) -> None:
        """End it, and all that it started."""
        now = time.monotonic()
        end, again = now + GRACE_S, now + AGAIN_S
        with suppress(ProcessLookupError):
            os.killpg(self._pid, signal.SIGUSR1)
            os.killpg(self._pid, signal.SIGCONT)  # one that was stopped would never hear of it
        while self._is_running() and time.monotonic() < end:
            with suppress(EOFError, OSError):  # who waits to tell must not wait for us
                if self._answers.poll(0.01):
                    self._answers.recv()
            if time.monotonic() > again:
                again += AGAIN_S
                os.kill(self._pid, signal.SIGUSR1)
            time.sleep(0.005)
        with suppress(ProcessLookupError):
            os.killpg(self._pid, signal.SIGKILL)
        self._wait()
        self._answers.close()

    def _is_running(self) -> bool:
        if self._code is None:
            pid, status = os.waitpid(self._pid, os.WNOHANG)
            if pid:
                self._code = os.waitstatus_to_exitcode(status)
        return self._code is None

    def _wait(self) -> int:
        if self._code is None:
            self._code = os.waitstatus_to_exitcode(os.waitpid(self._pid, 0)[1])
        return self._code


class _Stopped(BaseException):
    """Time is over: whatever is going on is left, its `finally` blocks are not."""


def _try(kind: Kind, plan: Plan, inlet: Connection) -> NoReturn:
    """Send each outcome; never return.

    The signal goes to all of the group: what it forked leaves in the same way, what it started
    otherwise dies of it.
    """
    code = 1
    try:
        os.setpgid(0, 0)
        signal.signal(signal.SIGUSR1, _stop)
        with closing(kind(plan)) as outcomes:
            for outcome in islice(outcomes, plan.faults):
                inlet.send(outcome)
                if _is_stopped():  # and the kind took the signal for a fault of its own
                    break
        code = 0
    except CannotTryError as error:
        inlet.send(error)
        code = 0
    except _Stopped:
        code = 0
    except BaseException:  # noqa: BLE001 - it is told like any other fault
        inlet.send(Outcome("the kind itself", problem=traceback.format_exc()))
        code = 0
    finally:
        os._exit(code)


def _is_stopped() -> bool:
    return bool(_stops)


def _stop(*_: object) -> None:
    _stops.append(time.monotonic())
    warnings.simplefilter("ignore")  # such as Python's of helpers of its own that ended, too
    sys.unraisablehook = lambda _: None  # raised in a finalizer it gets lost: then it comes again
    raise _Stopped


_stops: list[float] = []
"""When this process was told to stop."""
