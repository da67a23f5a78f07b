"""What doors and levels were called at the time of an event, by all that is known now."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.batches.event_batch import EventBatch
from semmap_log.domain.events import (
    ADDING_KINDS,
    DOOR_KINDS,
    KINDS,
    DoorAnnotated,
    FloorMap,
    LevelAdded,
    field_names,
)
from semmap_log.domain.meaning import Changed
from semmap_log.folds.annotations import NAME
from semmap_log.folds.door_changes import Stamp, columns, parts_of
from semmap_log.folds.last_written import LastWritten

Texts = tuple[NDArray[np.intp], Sequence[str]]
"""Of each event the place of its text among some; an empty one: there is none."""

NOTHING = ""
_NO_LEVEL = -1
_LEVEL_CHANGE = columns("door_id", "folds_ns", "number", "level")
_TELLING_KINDS = (DoorAnnotated.kind, LevelAdded.kind)
_ON_A_LEVEL = [kind.kind for kind in KINDS
               if kind.kind not in DOOR_KINDS and "level" in field_names(kind)]  # fmt: skip
"""Kinds that are about no door, and say on which level they happened."""


class NamesThen:
    """Takes in events that say names and levels, in any order; then tells those of other events.

    A door's name is what was said last when the event happened, since the door was added; a door
    that was removed keeps its last. A level without a name is called by its number.
    """

    def __init__(self) -> None:
        self._added: dict[int, Stamp] = {}
        self._said: list[tuple[int, Stamp, str]] = []
        self._moves = [np.empty(0, _LEVEL_CHANGE)]
        self._called: list[tuple[int, Stamp, str]] = []
        self._found: dict[str, Any] = {}

    def apply(self, batch: EventBatch) -> None:
        """Take in events, retracted ones left out."""
        folds_ns = batch.folds_ns.tolist()
        for kind in (kind for kind in ADDING_KINDS if kind in batch):
            for door_id, at in zip(
                batch[kind]["door_id"].tolist(), batch.where(kind).tolist(), strict=True
            ):
                self._added[door_id] = (folds_ns[at], int(batch.number[at]))
        self._moves += parts_of(batch, _LEVEL_CHANGE, setting=int(Changed.POSE))
        for told in _TELLING_KINDS:
            for event, at in zip(
                batch.objects.get(told, ()), batch.places_of(told).tolist(), strict=True
            ):
                stamp = (folds_ns[at], int(batch.number[at]))
                if isinstance(event, LevelAdded):
                    self._called.append((event.level, stamp, event.name))
                elif isinstance(event, DoorAnnotated) and event.key == NAME:
                    self._said.append((event.door_id, stamp, event.value))

    def door_names(self, batch: EventBatch) -> Texts:
        """Return what the door of each event was called then."""
        names, texts = self._once("doors", lambda: _texts_over_time(self._names_of_doors()))
        codes = names.at(batch.door_ids(), batch.folds_ns, batch.number)
        return np.where(batch.about_doors(), codes, 0), texts

    def level_names(self, batch: EventBatch) -> Texts:
        """Return what the level was called on which each event's door, robot or map was then."""
        names, texts = self._once("levels", lambda: _texts_over_time(self._called))
        levels = self._levels(batch)
        codes = names.at(np.maximum(levels, 0), batch.folds_ns, batch.number)
        nameless = np.flatnonzero((codes == 0) & (levels != _NO_LEVEL))
        codes[levels == _NO_LEVEL] = 0
        if not len(nameless):
            return codes, texts
        numbers = np.flatnonzero(np.bincount(levels[nameless]))
        codes[nameless] = len(texts) + np.searchsorted(numbers, levels[nameless])
        return codes, [*texts, *map(str, numbers.tolist())]

    def _levels(self, batch: EventBatch) -> NDArray[np.int64]:
        """Return on which level the door, the robot or the map of each event was; -1: on none."""
        of_doors: LastWritten = self._once("moves", self._levels_of_doors)
        found = of_doors.at(batch.door_ids(), batch.folds_ns, batch.number)
        found[~batch.about_doors()] = _NO_LEVEL
        for kind in _ON_A_LEVEL:
            if kind in batch.columns:
                found[batch.places_of(kind)] = batch.columns[kind]["level"]
            elif kind in batch.objects:
                told = [getattr(event, "level", _NO_LEVEL) for event in batch.objects[kind]]
                found[batch.places_of(kind)] = told
        return found

    def _levels_of_doors(self) -> LastWritten:
        moves = np.concatenate(self._moves)
        added = np.array([self._added.get(d, (0, -1)) for d in moves["door_id"].tolist()], np.int64)
        ns, number = added.reshape(-1, 2).T
        is_there = (moves["folds_ns"] > ns) | (
            (moves["folds_ns"] == ns) & (moves["number"] >= number)
        )
        moves = moves[is_there]
        return LastWritten(
            *(moves[name].astype(np.int64) for name in ("door_id", "folds_ns", "number", "level")),
            nothing=_NO_LEVEL,
        )

    def _names_of_doors(self) -> list[tuple[int, Stamp, str]]:
        return [each for each in self._said if each[1] > self._added.get(each[0], (0, -1))]

    def _once(self, name: str, make: Callable[[], Any]) -> Any:
        if name not in self._found:
            self._found[name] = make()
        return self._found[name]


def levels_told(batch: EventBatch) -> set[int]:
    """Return the levels that events name, draw, or put new doors on."""
    found: set[int] = set()
    for kind in (kind for kind in ADDING_KINDS if kind in batch):
        found.update(batch[kind]["level"].tolist())
    for told in (LevelAdded.kind, FloorMap.kind):
        events = batch.objects.get(told, ())
        found.update(e.level for e in events if isinstance(e, LevelAdded | FloorMap))
    return found


def _texts_over_time(said: Sequence[tuple[int, Stamp, str]]) -> tuple[LastWritten, list[str]]:
    """Return texts by key and stamp as places among some; the first is of what says nothing."""
    known = {NOTHING: 0}
    rows = [(key, *stamp, known.setdefault(text, len(known))) for key, stamp, text in said]
    keys, ns, numbers, codes = np.array(rows, np.int64).reshape(-1, 4).T
    return LastWritten(keys, ns, numbers, codes, nothing=0), list(known)
