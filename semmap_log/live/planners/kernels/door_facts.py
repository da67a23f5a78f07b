"""The doors as facts that kernels know.

    (DOOR_STATE DOOR_3 OPEN)           or CLOSED UNKNOWN MOVING OFFLINE, or REMOVED
    (DOOR_PROBABILITY DOOR_3 0.75)     its P(open) in the map; NIL: it has none any more
    (DOOR_NAME DOOR_3 "main door")     NIL: it has none any more
    (DOOR_MAP SEMMAP)                  all facts follow, if they were not asked for
    (DOOR_FACTS SEMMAP 5)              all facts of five doors have been told, by SEMMAP

A door has a fact of each kind at most: `declare ff` in a kernel lets the new one replace the old.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.live.planners.door_view import atom_of, atom_of_state
from semmap_log.live.planners.kernels.s_expressions import Expression, sendable
from semmap_log.live.planners.question_lines import NIL, Atom
from semmap_log.live.ros.serving.served_topics import ChangedDoors

Fact: TypeAlias = tuple[Expression, ...]

STATE, PROBABILITY, NAME = Atom("DOOR_STATE"), Atom("DOOR_PROBABILITY"), Atom("DOOR_NAME")
REMOVED = Atom("REMOVED")


class DoorFacts:
    """The facts of all doors, as they were told last."""

    def __init__(self) -> None:
        self._changes = ChangedDoors()
        self._told: dict[DoorId, dict[Atom, Expression]] = {}

    def take(self, doors: DoorMap) -> list[Fact]:
        """Return the facts that are new or other than before; the first time, all."""
        news: list[Fact] = []
        for door_id, door in self._changes.take(doors).items():
            before = self._told.pop(door_id, {})
            now = {} if door is None else _facts(door)
            if door is not None:
                self._told[door_id] = now
            gone = {kind: REMOVED if kind is STATE else Atom(NIL) for kind in before}
            news += [
                (kind, atom_of(door_id), value)
                for kind, value in (gone | now).items()
                if kind not in before or before[kind] != value
            ]
        return news

    def all(self) -> list[Fact]:
        """Return all facts, ids ascending."""
        return [
            (kind, atom_of(door_id), value)
            for door_id in sorted(self._told)
            for kind, value in self._told[door_id].items()
        ]

    def complete(self, name: str) -> Fact:
        """Return the fact that all were told.

        Args:
            name: Of who tells them.
        """
        return Atom("DOOR_FACTS"), Atom(name), len(self._told)


def _facts(door: Door) -> dict[Atom, Expression]:
    facts: dict[Atom, Expression] = {STATE: atom_of_state(door)}
    if not math.isnan(door.prob_open):
        facts[PROBABILITY] = door.prob_open
    if door.name:
        facts[NAME] = sendable(door.name)
    return facts
