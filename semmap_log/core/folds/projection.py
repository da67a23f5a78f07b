"""What a projection is: a fold of events to a state, as a user writes one of their own.

    from collections import Counter
    from semmap_log.core.model.events import DoorObserved

    class Openings:
        '''How often each door was seen open that was seen closed before.'''

        def initial(self):
            return {"times": Counter(), "last": {}}

        def apply(self, state, batch):
            if DoorObserved in batch:
                seen = batch[DoorObserved]  # numpy columns
                for door, now in zip(seen["door_id"].tolist(), seen["state"].tolist()):
                    if (state["last"].get(door), now) == (CLOSED, OPEN):
                        state["times"][door] += 1
                    state["last"][door] = now
            return state

`log.fold(Openings(), checkpoint="openings")` continues where it stopped the last time, and
`for now in log.fold_live(Openings()): …` yields `now.state` while another process writes.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeVar, runtime_checkable

from semmap_log.core.batches.event_batch import EventBatch

S = TypeVar("S")

SAVE_EVERY_S = 10.0
"""A checkpoint is written at the end, and so often before that."""


class Projection(Protocol[S]):
    """A fold: these two methods, which look at nothing but what they are given.

    Batches come in the order of event numbers, of any size, retracted events left out. That is the
    order in which the log learnt of the events, not in which they happened: `batch.folds_ns` says
    when that was. Further methods and attributes may be there:

    - `merge`, where the fold allows it, for who folds a log in parts: see `Mergeable`;
    - `dump` and `load`, for states of any type in checkpoints: see `Dumping`;
    - `name` and `version`: what a checkpoint calls the projection, by default the name of its class
      and 1. Whatever decides on the state (a bin's width, a list of doors) belongs into one of
      them: a checkpoint of another version is not used.
    """

    def initial(self) -> S:
        """Return the state before the first event: a new one at each call."""

    def apply(self, state: S, batch: EventBatch, /) -> S:
        """Return the state after the batch; `state` itself may be changed and returned."""


@runtime_checkable
class Mergeable(Protocol[S]):
    """A projection whose states of two parts of a log make the state of both.

    `log.fold_part` gives the states of parts, in as many processes as one likes.
    """

    def merge(self, earlier: S, later: S, /) -> S:
        """Return the state of all events.

        Args:
            earlier: What events up to some number make of `initial()`.
            later: What the events after them make of another `initial()`.
        """


@runtime_checkable
class Dumping(Protocol[S]):
    """A projection that makes bytes of its state itself, for states that are not plain values."""

    def dump(self, state: S, /) -> bytes:
        """Return the state as bytes."""

    def load(self, data: bytes, /) -> S:
        """Return the state that `dump` made these bytes of."""


def name_of(projection: Projection[Any]) -> str:
    """Return what a checkpoint calls the projection."""
    return str(getattr(projection, "name", type(projection).__qualname__))


def version_of(projection: Projection[Any]) -> str:
    """Return the version of the projection's states."""
    return str(getattr(projection, "version", 1))
