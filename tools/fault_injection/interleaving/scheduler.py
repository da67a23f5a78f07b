"""Who runs next: real threads, of which exactly one runs, and how the next one is drawn.

At every point where threads can meet (a lock, an event, a write) the running one asks the
scheduler, which draws who goes on. A wait with a timeout may end at any such point, as on a busy
machine it may. When nobody can go on, that is a deadlock, and it is told with everybody's stack.

The second finds what needs few switches at the right places soonest. (Burckhardt et al., "A
Randomized Scheduler with Probabilistic Guarantees of Finding Bugs", ASPLOS 2010: PCT.)
"""

from __future__ import annotations

import random
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from typing import Protocol

MOST_STEPS = 200_000
"""A run that takes more goes round in circles."""


class Chooser(Protocol):
    """Draws who runs next."""

    def choose(self, able: list[Task], now: Task, point: str) -> Task:
        """Return one of those that can go on; `now` ran until this point."""

    def begun(self, task: Task) -> None:
        """Take note of a new thread."""


class Task:
    """A thread under the scheduler."""

    def __init__(self, number: int, name: str) -> None:
        self.number = number
        self.name = name
        self.gate = threading.Semaphore(0)
        self.thread: threading.Thread | None = None
        self.is_over = False
        self.is_ready: Callable[[], bool] | None = None
        """What it waits for; None: nothing."""
        self.is_timed = False
        """Whether it may stop waiting at any time."""
        self.point = ""
        """Where it stands."""

    @property
    def is_able(self) -> bool:
        """Whether it can go on without a timeout."""
        return not self.is_over and (self.is_ready is None or self.is_ready())

    @property
    def may_time_out(self) -> bool:
        """Whether it can go on by giving up its wait."""
        return not self.is_over and self.is_timed and not self.is_able


class StuckError(Exception):
    """Nobody can go on, or nobody comes to an end; says who stands where."""


class Scheduler:
    """Owns all switches between its tasks."""

    def __init__(self, chooser: Chooser) -> None:
        self._chooser = chooser
        self._tasks: list[Task] = []
        self._of_thread: dict[int, Task] = {}
        self._over = threading.Event()
        self.steps = 0
        self.stuck = ""
        """Why the run did not end, and all stacks; empty: it did."""

    def run(self, main: Callable[[], None], timeout_s: float) -> None:
        """Run a function as the first task, with all threads that it starts, until it returns.

        Raises:
            StuckError: It does not return.
        """
        task = self.begin("main")
        thread = threading.Thread(target=self._main, args=(task, main), daemon=True)
        self.attach(task, thread)
        thread.start()
        task.gate.release()
        if not self._over.wait(timeout_s):
            self.stuck = self._told(f"no end after {timeout_s:.0f} s and {self.steps} steps")
        if self.stuck:
            raise StuckError(self.stuck)

    def begin(self, name: str) -> Task:
        """Return a new task; its thread must wait at its gate."""
        task = Task(len(self._tasks), name)
        self._tasks.append(task)
        self._chooser.begun(task)
        return task

    def attach(self, task: Task, thread: threading.Thread) -> None:
        """Say which thread is the task's."""
        task.thread = thread

    def enter(self, task: Task) -> None:
        """Wait for the first turn; called by the task's own thread, first of all."""
        self._of_thread[threading.get_ident()] = task
        task.gate.acquire()

    def me(self) -> Task | None:
        """Return the task that calls; None for a thread that is none of ours."""
        return self._of_thread.get(threading.get_ident())

    def switch(self, point: str) -> None:
        """Let another task go on, or not; returns when it is the caller's turn again."""
        task = self.me()
        if task is not None and not self._over.is_set():
            task.point = point
            self._hand_over(task)

    def wait(self, is_ready: Callable[[], bool], point: str, *, timed: bool = False) -> bool:
        """Return once `is_ready`, or, if it may, some time before: whether it is."""
        task = self.me()
        if task is None:
            return is_ready()
        task.is_ready, task.is_timed, task.point = is_ready, timed, point
        self._hand_over(task)
        task.is_ready, task.is_timed = None, False
        return is_ready()

    def leave(self, task: Task) -> None:
        """End a task; called by its own thread, last of all."""
        task.is_over = True
        if self._over.is_set():
            return
        chosen = self._next(task)
        if chosen is not None:
            chosen.gate.release()

    def _main(self, task: Task, main: Callable[[], None]) -> None:
        self.enter(task)
        try:
            main()
        finally:
            task.is_over = True
            self._over.set()

    def _hand_over(self, task: Task) -> None:
        chosen = self._next(task)
        if chosen is task:
            return
        if chosen is not None:
            chosen.gate.release()
        task.gate.acquire()

    def _next(self, now: Task) -> Task | None:
        """Return who goes on; None: nobody can, and the run is over."""
        self.steps += 1
        able = [task for task in self._tasks if task.is_able]
        late = [task for task in self._tasks if task.may_time_out]
        if not (able or late) or self.steps > MOST_STEPS:
            self.stuck = self._told("a deadlock" if not (able or late) else "no end")
            self._over.set()
            return None
        if len(able) + len(late) == 1:
            return (able + late)[0]  # no choice: nothing is drawn, and nothing counted
        return self._chooser.choose(able + late, now, now.point)

    def _told(self, what: str) -> str:
        frames = sys._current_frames()  # noqa: SLF001 - there is no other way
        said = [what]
        for task in self._tasks:
            if task.is_over or task.thread is None:
                continue
            frame = frames.get(task.thread.ident or 0)
            theirs = [f for f in traceback.extract_stack(frame) if not _is_ours(f.filename)]
            stack = "".join(traceback.format_list(theirs)[-6:])
            said.append(f"{task.name} at {task.point}:\n{stack}")
        return "\n".join(said)


def _is_ours(file: str) -> bool:
    """Tell whether a frame is of the scheduler, not of the program that it runs."""
    return "interleaving/" in file or file.endswith("threading.py")


LINE = "line"
"""The point before a line of the program: there are far more of these than of all others."""


class RandomWalk:
    """Anybody may go on, at any point."""

    def __init__(self, dice: random.Random) -> None:
        self._dice = dice
        self._stay = dice.choice((0.0, 0.3, 0.7))
        self._stay_at_line = dice.choice((0.9, 0.97, 0.995))

    def begun(self, task: Task) -> None:
        """Nothing is remembered of tasks."""

    def choose(self, able: list[Task], now: Task, point: str) -> Task:
        """Return one of those that can go on."""
        stay = self._stay_at_line if point == LINE else self._stay
        if now in able and not now.may_time_out and self._dice.random() < stay:
            return now
        sure = [task for task in able if not task.may_time_out]
        if sure and self._dice.random() < 0.8:
            return self._dice.choice(sure)
        return self._dice.choice(able)


class Priorities:
    """The one with the greatest priority goes on; at a few points it becomes the least."""

    def __init__(self, dice: random.Random, *, steps: int) -> None:
        """Draw.

        Args:
            dice: Draws.
            steps: How long the run may be.
        """
        self._dice = dice
        changes = dice.randint(1, 5)
        self._changes = {dice.randrange(steps) for _ in range(changes)}
        self._priority: dict[int, float] = {}
        self._least = 0.0
        self._step = 0

    def begun(self, task: Task) -> None:
        """Draw its priority."""
        self._priority[task.number] = self._dice.random()

    def choose(self, able: list[Task], now: Task, point: str) -> Task:
        """Return the first by priority; who only waits for a timeout comes last."""
        del point
        self._step += 1
        if self._step in self._changes:
            self._put_last(now)
        chosen = max(able, key=lambda t: (not t.may_time_out, self._priority[t.number]))
        if chosen.may_time_out:
            self._put_last(chosen)
        return chosen

    def _put_last(self, task: Task) -> None:
        self._least -= 1
        self._priority[task.number] = self._least


class Parking:
    """One thread is left standing at a drawn point, and all others go as far as they can.

    The points are drawn by what is done there, so that a write is met as often as a lock, though
    there are far more locks.
    """

    def __init__(self, dice: random.Random, points: Mapping[str, int]) -> None:
        """Draw.

        Args:
            dice: Draws.
            points: What may be done there, and how often at most it was done before.
        """
        self._dice = dice
        self._parks: dict[str, set[int]] = {}
        for point in dice.choices(list(points), k=dice.randint(2, 8)):
            self._parks.setdefault(point, set()).add(dice.randrange(points[point]))
        self._seen: dict[str, int] = {}
        self._parked: dict[int, int] = {}
        """Task -> for how many steps yet."""
        self._restless = dice.choice((0.0, 0.01, 0.1))

    def begun(self, task: Task) -> None:
        """Nothing is remembered of a new task."""

    def choose(self, able: list[Task], now: Task, point: str) -> Task:
        """Return the one that ran, unless it is left standing."""
        seen = self._seen.get(point, 0)
        self._seen[point] = seen + 1
        if seen in self._parks.get(point, ()):
            self._parked[now.number] = self._dice.choice((5, 50, 500, 5000))
        self._parked = {task: left - 1 for task, left in self._parked.items() if left}
        moving = [task for task in able if task.number not in self._parked]
        sure = [task for task in moving if not task.may_time_out]
        if now in sure and self._dice.random() >= self._restless:
            return now
        return self._dice.choice(sure or moving or able)
