"""The door map as anybody would fold it: dictionaries, one event at a time.

Takes our events as well as messages that a reader decoded, since both have the same fields.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

from benchmark.patrol import patrol

if TYPE_CHECKING:
    from semmap_log.doors import DoorMap

TOPICS = (
    "/semmap/door_added", "/semmap/door_updated", "/semmap/door_removed", "/semmap/door_observed",
    "/semmap/door_passed", "/semmap/door_annotated",
)  # fmt: skip
"""What a reader must read to know the doors; the fold of everything else does nothing."""

OPEN = 1
POSE, WIDTH, STATE, PROB_OPEN, PROB_CLOSED = 1, 2, 4, 8, 16
"""The bits of DoorUpdated.changed."""

Stamp = tuple[int, int]
Answer = dict[int, tuple[str, ...]]
"""Door -> level, x, y, theta, width, state, prob_open, prob_closed, last seen, name: as text, since
NaN is not equal to itself."""


class PlainFold:
    """Each field of a door keeps the value with the greatest (happened time, event number)."""

    def __init__(self) -> None:
        self._doors: dict[int, dict[str, tuple[Stamp, Any]]] = {}

    def apply(self, kind: str, said: Any, stamp: Stamp) -> None:
        """Fold one event in."""
        if kind == "DoorObserved":
            self._set(said.door_id, "state", stamp, int(said.state))
        elif kind == "DoorPassed":
            if said.passed:
                self._set(said.door_id, "state", stamp, OPEN)
        elif kind == "DoorUpdated":
            self._set_fields(said, int(said.changed), stamp)
        elif kind == "DoorAdded":
            self._set(said.door_id, "added", stamp, True)
            self._set_fields(said, POSE | WIDTH | STATE | PROB_OPEN | PROB_CLOSED, stamp)
        elif kind == "DoorRemoved":
            self._set(said.door_id, "removed", stamp, True)
        elif kind == "DoorAnnotated" and said.key == "name":
            self._set(said.door_id, "name", stamp, said.value)

    def answer(self) -> Answer:
        """Return the doors that are in the map."""
        return {
            door_id: tuple(self._texts(fields))
            for door_id, fields in sorted(self._doors.items())
            if "added" in fields and "removed" not in fields
        }

    def _set_fields(self, said: Any, changed: int, stamp: Stamp) -> None:
        if changed & POSE:
            pose = (said.level, said.x, said.y, said.theta)
            self._set(said.door_id, "pose", stamp, pose)
        if changed & WIDTH:
            self._set(said.door_id, "width", stamp, said.width)
        if changed & STATE:
            self._set(said.door_id, "state", stamp, int(said.state))
        if changed & PROB_OPEN:
            self._set(said.door_id, "prob_open", stamp, said.prob_open)
        if changed & PROB_CLOSED:
            self._set(said.door_id, "prob_closed", stamp, said.prob_closed)

    def _set(self, door_id: int, field: str, stamp: Stamp, value: object) -> None:
        fields = self._doors.setdefault(door_id, {})
        known = fields.get(field)
        if known is None or stamp > known[0]:
            fields[field] = (stamp, value)

    def _texts(self, fields: dict[str, tuple[Stamp, Any]]) -> Iterator[str]:
        yield from map(repr, fields["pose"][1])
        for name in ("width", "state", "prob_open", "prob_closed"):
            yield repr(fields[name][1])
        yield repr(fields["state"][0][0])
        yield fields["name"][1] if "name" in fields else ""


def answer_of(door_map: DoorMap) -> Answer:
    """Return the same of our own replay."""
    return {
        int(door.door_id): (
            repr(door.level), repr(door.x), repr(door.y), repr(door.theta), repr(door.width),
            repr(int(door.state)), repr(door.prob_open), repr(door.prob_closed),
            repr(door.last_seen_ns), door.name or "",
        )
        for door in door_map.doors.values()
    }  # fmt: skip


@cache
def plain_answer(count: int, first: int | None = None, at_ns: int | None = None) -> Answer:
    """Return the doors after a patrol, never having been in a log.

    Args:
        count: How many events the patrol has.
        first: Only so many of them, from the start; None: all.
        at_ns: Only what had happened by then; None: all.
    """
    fold = PlainFold()
    for number, event in enumerate(patrol(count)):
        if number == first:
            break
        assert event.happened_ns is not None
        if at_ns is None or event.happened_ns <= at_ns:
            fold.apply(type(event).__name__, event, (event.happened_ns, number))
    return fold.answer()
