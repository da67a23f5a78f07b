"""Projections that workers import: well-behaved ones, and such as end their process."""

from __future__ import annotations

import os
import signal
import time
from collections import Counter
from typing import Any

from semmap_log.core.model.events import DoorObserved


class Sightings:
    """How often each door was seen: a projection that can merge."""

    version = "2"

    def initial(self) -> Counter[int]:
        return Counter()

    def apply(self, state: Counter[int], batch: Any) -> Counter[int]:
        if DoorObserved in batch:
            state.update(batch[DoorObserved]["door_id"].tolist())
        return state

    def merge(self, earlier: Counter[int], later: Counter[int]) -> Counter[int]:
        return Counter(earlier + later)


class Whole(Sightings):
    """The same, which cannot be merged."""

    merge = None  # type: ignore[assignment]


class Slowly(Sightings):
    """The same, in a quarter of a second a log."""

    def initial(self) -> Counter[int]:
        time.sleep(0.25)
        return super().initial()


class Raises(Sightings):
    def apply(self, state: Counter[int], batch: Any) -> Counter[int]:
        raise ZeroDivisionError("a user's own")


class KillsItsWorker(Sightings):
    """As a log does whose answer takes more memory than there is: it ends the process."""

    def __init__(self, doors: int) -> None:
        self._doors = doors
        self.version = f"kills {doors}"

    def apply(self, state: Counter[int], batch: Any) -> Counter[int]:
        state = super().apply(state, batch)
        if len(state) == self._doors:
            os.kill(os.getpid(), signal.SIGKILL)
        return state


class KillsOnce(Sightings):
    """The first worker that comes here is killed."""

    def __init__(self, mark: str) -> None:
        self._mark = mark
        self.version = mark

    def apply(self, state: Counter[int], batch: Any) -> Counter[int]:
        try:
            os.close(os.open(self._mark, os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return super().apply(state, batch)
        os.kill(os.getpid(), signal.SIGKILL)
        return state
