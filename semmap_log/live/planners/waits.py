"""Questions that wait until a door is in a state."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from semmap_log.core.model.doors import DoorState
from semmap_log.errors import UnknownDoorError
from semmap_log.live.planners.door_view import DoorView
from semmap_log.live.planners.question_lines import Answer


@dataclass(frozen=True, slots=True, eq=False)
class Wait:
    """A question that waits."""

    door: str
    state: DoorState
    done: Callable[[Answer], None]
    """Told the answer, once, by whichever thread has it first."""

    def answer_in(self, view: DoorView) -> Answer | None:
        """Return the answer that the doors as they are give; None: wait on."""
        try:
            return Answer(value=True) if view.door(self.door).state is self.state else None
        except UnknownDoorError as error:
            return Answer(value=False, reason=str(error))


class Waits:
    """All that wait; may be used by several threads."""

    def __init__(self) -> None:
        self._waiting: set[Wait] = set()
        self._mutex = threading.Lock()

    def add(self, wait: Wait) -> None:
        """Let it wait; who adds it looks at the doors as they are after that."""
        with self._mutex:
            self._waiting.add(wait)

    def doors(self) -> set[str]:
        """Return the doors that are waited for, as they were called."""
        with self._mutex:
            return {wait.door for wait in self._waiting}

    def look(self, view: DoorView) -> None:
        """Answer those that need to wait no longer."""
        with self._mutex:
            waiting = list(self._waiting)
        for wait in waiting:
            answer = wait.answer_in(view)
            if answer is not None:
                self.end(wait, answer)

    def end(self, wait: Wait, answer: Answer) -> None:
        """Answer it, unless it was answered."""
        with self._mutex:
            if wait not in self._waiting:
                return
            self._waiting.remove(wait)
        wait.done(answer)
