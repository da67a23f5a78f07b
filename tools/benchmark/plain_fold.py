"""The door map as anybody would fold it: what every answer is compared with.

`PlainFold` takes one event at a time, in dictionaries: our events, or messages that a reader
decoded, since both have the same fields. `plain_answers` is the same for a patrol that has never
been in a log, by sorting its columns: the dictionaries would take minutes for ten million events.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from benchmark.patrol import (
    ADDED,
    CHANGED_PLACE,
    CHANGED_STATE,
    NAMED,
    OBSERVED,
    OPEN,
    PASSED,
    REMOVED,
    UPDATED,
    Rows,
    blocks,
    name_of,
)

if TYPE_CHECKING:
    from semmap_log.core.model.doors import DoorMap

TOPICS = (
    "/semmap/door_added", "/semmap/door_updated", "/semmap/door_removed", "/semmap/door_observed",
    "/semmap/door_passed", "/semmap/door_annotated",
)  # fmt: skip
"""What a reader must read to know the doors; the fold of everything else does nothing."""

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


def answer_of_rows(rows: Iterable[Sequence[Any]]) -> Answer:
    """Return the same of a query's rows: door, then the fields in that order."""
    return {row[0]: (*map(repr, row[1:-1]), row[-1] or "") for row in rows}


def plain_answer(count: int, first: int | None = None, at_ns: int | None = None) -> Answer:
    """Return the doors after a patrol; see `plain_answers`."""
    return plain_answers(count, first, (at_ns,))[at_ns]


@cache
def plain_answers(
    count: int, first: int | None, moments: tuple[int | None, ...], *, late_counts: bool = True
) -> dict[int | None, Answer]:
    """Return the doors after a patrol, never having been in a log.

    Args:
        count: How many events the patrol has.
        first: Only so many of them, from the start; None: all.
        moments: For each of them: only what had happened by then; None: all.
        late_counts: Whether events count by when they happened; else by their numbers.
    """
    latest: dict[int | None, dict[str, Rows]] = {at_ns: {} for at_ns in moments}
    for rows in blocks(count):
        told = rows if first is None else rows[rows["number"] < first]
        for at_ns, kept in latest.items():
            inside = told if at_ns is None else told[told["happened_ns"] <= at_ns]
            for field, writes in writers(inside).items():
                both = np.concatenate([kept[field], inside[writes]]) if field in kept else (
                    inside[writes])  # fmt: skip
                kept[field] = _last_of_each_door(both, late_counts=late_counts)
        if len(told) < len(rows):
            break
    return {at_ns: _answer(kept) for at_ns, kept in latest.items()}


def writers(rows: Rows) -> dict[str, NDArray[np.bool_]]:
    """Return which events set which field of a door."""
    what, changed = rows["what"], rows["changed"]
    added, updated = what == ADDED, what == UPDATED
    place = added | (updated & (changed == CHANGED_PLACE))
    stated = added | (updated & (changed == CHANGED_STATE))
    passed = (what == PASSED) & rows["passed"]
    return {
        "added": added, "removed": what == REMOVED, "place": place, "prob_open": stated,
        "state": stated | (what == OBSERVED) | passed, "prob_closed": added,
        "name": what == NAMED,
    }  # fmt: skip


def states(rows: Rows) -> NDArray[np.uint8]:
    """Return the state that each event sets, if it sets one."""
    return np.where(rows["what"] == PASSED, OPEN, rows["state"]).astype("u1")


def _last_of_each_door(rows: Rows, *, late_counts: bool) -> Rows:
    time = rows["happened_ns"] if late_counts else rows["number"]
    rows = rows[np.lexsort((rows["number"], time, rows["door_id"]))]
    is_last = np.append(rows["door_id"][1:] != rows["door_id"][:-1], True)[: len(rows)]
    last: Rows = rows[is_last]
    return last


def _answer(latest: dict[str, Rows]) -> Answer:
    of = {field: {int(row["door_id"]): row for row in rows} for field, rows in latest.items()}
    answer = {}
    for door in sorted(of["added"].keys() - of["removed"].keys()):
        place, state, name = of["place"][door], of["state"][door], of["name"].get(door)
        answer[door] = (
            "0", *(repr(float(place[field])) for field in ("x", "y", "theta", "width")),
            repr(int(states(state[None])[0])), repr(float(of["prob_open"][door]["value"])),
            repr(float(of["prob_closed"][door]["value"])), repr(int(state["happened_ns"])),
            "" if name is None else name_of(door),
        )  # fmt: skip
    return answer
