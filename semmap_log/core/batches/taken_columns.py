"""Events one by one, with what was taken out of all of them already.

Whoever checks many events looks at their kinds, doors and times, and so does whoever packs them:
each look at a hundred events is a fiftieth of the time that a durable commit of them takes.

The columns that a batch of each kind is made from, spelt out for editors and type checkers.

The signatures are written by `python tools/batch_columns.py`, from the table of events.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

from numpy.typing import ArrayLike

from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import (
    DoorAdded,
    DoorEvent,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    SightingsThinned,
    field_names,
)
from semmap_log.core.model.keywords import unknown_keyword

if TYPE_CHECKING:
    from typing_extensions import Self


class TakenColumns(list[DoorEvent]):
    """Events about doors in a list that stays as it is; doors and times are columns, too."""

    __slots__ = ("_are_timed", "door_ids", "happened_ns", "kinds")

    def __init__(self, events: Sequence[DoorEvent], kinds: set[type[Any]]) -> None:
        """Take doors and times out of events.

        Args:
            events: The events.
            kinds: Their classes.
        """
        super().__init__(events)
        self.kinds = kinds
        self.door_ids: list[DoorId] = [event.door_id for event in events]
        self.happened_ns: list[int | None] = [event.happened_ns for event in events]
        self._are_timed = None not in self.happened_ns

    def given_times(self) -> list[int]:
        """Return when those happened that say it."""
        if self._are_timed:
            return self.happened_ns  # type: ignore[return-value]
        return [time for time in self.happened_ns if time is not None]

    def times_or(self, wall_ns: int) -> list[int]:
        """Return when each happened; one that does not say it: then."""
        if self._are_timed:
            return self.happened_ns  # type: ignore[return-value]
        return [wall_ns if time is None else time for time in self.happened_ns]


class MadeOfColumns:
    """What makes batches of one kind, from a column for each of the kind's fields."""

    __slots__ = ()

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorAdded],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        level: ArrayLike = ...,
        x: ArrayLike = ...,
        y: ArrayLike = ...,
        theta: ArrayLike = ...,
        width: ArrayLike = ...,
        state: ArrayLike = ...,
        prob_open: ArrayLike = ...,
        prob_closed: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorUpdated],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        changed: ArrayLike,
        level: ArrayLike = ...,
        x: ArrayLike = ...,
        y: ArrayLike = ...,
        theta: ArrayLike = ...,
        width: ArrayLike = ...,
        state: ArrayLike = ...,
        prob_open: ArrayLike = ...,
        prob_closed: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorRemoved],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorObserved],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        state: ArrayLike,
        accuracy_open: ArrayLike = ...,
        accuracy_closed: ArrayLike = ...,
        opening: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorRequested],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        state: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorPassed],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        passed: ArrayLike,
        waited_s: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[PatrolStarted],
        *,
        happened_ns: ArrayLike | None = None,
        patrol: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[PatrolFinished],
        *,
        happened_ns: ArrayLike | None = None,
        patrol: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[RobotPose],
        *,
        happened_ns: ArrayLike | None = None,
        x: ArrayLike,
        y: ArrayLike,
        theta: ArrayLike,
        level: ArrayLike = ...,
        sd_xy: ArrayLike = ...,
        sd_theta: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[Retracted],
        *,
        happened_ns: ArrayLike | None = None,
        first_event: ArrayLike,
        last_event: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[SightingsThinned],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        state: ArrayLike,
        count: ArrayLike,
        first_ns: ArrayLike,
        last_ns: ArrayLike,
        accuracy_open: ArrayLike = ...,
        accuracy_closed: ArrayLike = ...,
        first_event: ArrayLike = ...,
    ) -> Self: ...

    @classmethod
    def of(
        cls, kind: type[Event], *, happened_ns: ArrayLike | None = None, **fields: ArrayLike
    ) -> Self:
        """Return events of one kind from columns, to append them.

            EventBatch.of(DoorObserved, door_id=ids, state=states, accuracy_open=0.9)

        Args:
            kind: Of fixed size.
            happened_ns: When each happened, int64; default: when the log records them.
            **fields: The kind's own fields; those left out have the defaults of the event. One
                value stands for all rows.

        Raises:
            UnknownKeywordError: The kind has no such field.
            InvalidEventError: Columns of different lengths, a value that no event can have, or
                that its type does not hold: nothing is wrapped or cut.
        """
        known = field_names(kind)
        for name in fields:
            if name not in known:
                raise unknown_keyword(
                    f"EventBatch.of({kind.__name__})", name, ["happened_ns", *known]
                )
        return cls._of_columns(kind, happened_ns, fields)

    @classmethod
    def _of_columns(
        cls, kind: type[Event], happened_ns: ArrayLike | None, fields: Mapping[str, ArrayLike]
    ) -> Self:
        """Return the batch; the names of the fields are known to be right."""
        raise NotImplementedError
