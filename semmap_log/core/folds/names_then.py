"""What doors and levels were called at the time of an event, by all that is known now."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.annotations import NAME
from semmap_log.core.folds.door_changes import Stamp, columns, parts_of
from semmap_log.core.folds.last_written import LastWritten
from semmap_log.core.model.doors import NO_LEVEL
from semmap_log.core.model.events import (
    ADDING_KINDS,
    DOOR_KINDS,
    KINDS,
    DoorAnnotated,
    FloorMap,
    LevelAdded,
    field_names,
)
from semmap_log.core.model.meaning import Changed

Texts = tuple[NDArray[np.intp], Sequence[str]]
"""Of each event the place of its text among some; an empty one: there is none."""

NOTHING = ""
_NEVER = (0, -1)
"""Comes before every stamp."""
_LEVEL_CHANGE = columns("door_id", "folds_ns", "number", "level")
_TELLING_KINDS = (DoorAnnotated.kind, LevelAdded.kind)
_ON_A_LEVEL = [kind.kind for kind in KINDS
               if kind.kind not in DOOR_KINDS and "level" in field_names(kind)]  # fmt: skip
"""Kinds that are about no door, and say on which level they happened."""


class NamesThen:
    """Takes in events that say names and levels, in any order; then tells those of other events.

    A door's name is what was said last when the event happened, since the door was added, by events
    of the same moment, too: as a replay of that moment tells it. A door that was removed keeps its
    last. A level without a name is called by its number.
    """

    def __init__(self) -> None:
        self._added: dict[int, Stamp] = {}
        self._said: list[tuple[int, Stamp, str]] = []
        self._moves = [np.empty(0, _LEVEL_CHANGE)]
        self._called: list[tuple[int, Stamp, str]] = []
        self._doors: _Called | None = None
        self._levels: _Called | None = None
        self._moved: LastWritten | None = None
        """Door -> its level; all three are made when somebody asks, and then nothing comes in."""

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
        if self._doors is None:
            self._doors = _Called(
                each for each in self._said if each[1] > self._added.get(each[0], _NEVER)
            )
        codes = self._doors.codes.at(batch.door_ids(), batch.folds_ns, _of_that_moment(batch))
        if 0 in self._doors.codes:  # else what is about no door has the name of none
            codes[~batch.about_doors()] = 0
        return codes, self._doors.texts

    def level_names(self, batch: EventBatch) -> Texts:
        """Return what the level was called on which each event's door, robot or map was then."""
        if self._levels is None:
            self._moved = self._levels_of_doors()
            self._levels = _Called(
                [
                    *((level, _NEVER, str(level)) for level in sorted({0, *self._moved.values()})),
                    *((level, stamp, name or str(level)) for level, stamp, name in self._called),
                ]
            )
        levels = self._levels_of(batch)
        codes = self._levels.codes.at(levels, batch.folds_ns, _of_that_moment(batch))
        nameless = np.flatnonzero((codes == 0) & (levels != NO_LEVEL))
        if not len(nameless):
            return codes, self._levels.texts
        numbers, places = np.unique(levels[nameless], return_inverse=True)
        codes[nameless] = len(self._levels.texts) + places
        return codes, [*self._levels.texts, *map(str, numbers.tolist())]

    def _levels_of(self, batch: EventBatch) -> NDArray[np.int64]:
        """Return on which level each event's door, robot or map was; `NO_LEVEL`: on none."""
        assert self._moved is not None
        levels = self._moved.at(batch.door_ids(), batch.folds_ns, batch.number)
        if 0 in self._moved:
            levels[~batch.about_doors()] = NO_LEVEL
        for kind in _ON_A_LEVEL:
            if kind in batch.columns:
                levels[batch.places_of(kind)] = batch.columns[kind]["level"]
            elif kind in batch.objects:
                told = [getattr(event, "level", NO_LEVEL) for event in batch.objects[kind]]
                levels[batch.places_of(kind)] = told
        return levels

    def _levels_of_doors(self) -> LastWritten:
        moves = np.concatenate(self._moves)
        added = np.array([self._added.get(d, _NEVER) for d in moves["door_id"].tolist()], np.int64)
        ns, number = added.reshape(-1, 2).T
        happened, number_of = moves["folds_ns"], moves["number"]
        moves = moves[(happened > ns) | ((happened == ns) & (number_of >= number))]
        return LastWritten(
            *(moves[name].astype(np.int64) for name in ("door_id", "folds_ns", "number", "level")),
            nothing=NO_LEVEL,
        )


def _of_that_moment(batch: EventBatch) -> NDArray[np.int64]:
    """Return numbers behind which, at the time of each event, nothing more was said."""
    return np.full(len(batch), np.iinfo(np.int64).max)


def levels_told(batch: EventBatch) -> set[int]:
    """Return the levels that events name, draw, or put new doors on."""
    found: set[int] = set()
    for kind in (kind for kind in ADDING_KINDS if kind in batch):
        found.update(batch[kind]["level"].tolist())
    for told in (LevelAdded.kind, FloorMap.kind):
        events = batch.objects.get(told, ())
        found.update(e.level for e in events if isinstance(e, LevelAdded | FloorMap))
    return found


class _Called:
    """Texts by key and stamp; an empty one says nothing."""

    def __init__(self, said: Iterable[tuple[int, Stamp, str]]) -> None:
        known = {NOTHING: 0}
        rows = [(key, *stamp, known.setdefault(text, len(known))) for key, stamp, text in said]
        keys, ns, numbers, codes = np.array(rows, np.int64).reshape(-1, 4).T
        self.codes = LastWritten(keys, ns, numbers, codes, nothing=0)
        self.texts = list(known)
