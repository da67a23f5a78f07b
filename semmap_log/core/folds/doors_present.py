"""The doors of a map as values, each made when it is asked for: of hundreds, one is wanted."""

from __future__ import annotations

from collections.abc import ItemsView, Iterator, Mapping, ValuesView
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.distinct import distinct
from semmap_log.core.folds.annotations import Annotations
from semmap_log.core.model.doors import Door, DoorId, DoorState, door_called
from semmap_log.core.model.meaning import FIELDS
from semmap_log.core.model.object_classes import CLASS, DOOR


class DoorsPresent(Mapping[DoorId, Door]):
    """Door id -> door, ids ascending; does not change. A door's name can be looked up, too."""

    def __init__(self, columns: Mapping[str, NDArray[Any]], annotations: Annotations) -> None:
        """Take the doors up.

        Args:
            columns: The fields of the doors and their stamps, one row a door, ids ascending.
            annotations: What is said of them; must not change any more.
        """
        self._columns = columns
        self._annotations = annotations
        self.classes = annotations.classes()
        """The classes of objects that are defined, names ascending."""
        self._ids: list[int] = columns["door_id"].tolist()
        self._places = dict(zip(self._ids, range(len(self._ids)), strict=True))
        self._made: dict[DoorId, Door] = {}
        """Those that were asked for, in the order in which they were."""
        self._everything: dict[DoorId, Door] | None = None
        """All of them, ids ascending, once somebody asked for all."""

    def __getitem__(self, door_id: DoorId | str) -> Door:
        if isinstance(door_id, str):
            return door_called(door_id, ((door, (door.name,)) for door in self.values()))
        door = self._made.get(door_id)
        if door is None:
            place = self._places[door_id]
            row = {name: column[place].item() for name, column in self._columns.items()}
            door = self._made[door_id] = self._door(row)
        return door

    def __iter__(self) -> Iterator[DoorId]:
        return map(DoorId, self._ids)

    def __len__(self) -> int:
        return len(self._ids)

    def __contains__(self, door_id: object) -> bool:
        return door_id in self._places

    def items(self) -> ItemsView[DoorId, Door]:
        """Return all doors with their ids."""
        return self._all().items()

    def values(self) -> ValuesView[Door]:
        """Return all doors."""
        return self._all().values()

    def placed_levels(self) -> set[int]:
        """Return the levels of all doors that have a place; none of the doors is made for it."""
        is_placed = ~np.isnan(self._columns["x"])
        return set(distinct(self._columns["level"][is_placed]).tolist())

    def in_state(self, state: DoorState) -> list[DoorId]:
        """Return the doors in a state, ids ascending; none of them is made for it."""
        states = self._columns["state"]
        chosen = states == state
        if state is DoorState.UNKNOWN:
            chosen |= states > max(DoorState)  # what only a later version knows
        return [DoorId(self._ids[place]) for place in np.flatnonzero(chosen).tolist()]

    def of_class(self, name: str) -> DoorsPresent:
        """Return those of a class only."""
        chosen = np.array([door.object_class.name == name for door in self.values()], np.bool_)
        columns = {field: column[chosen] for field, column in self._columns.items()}
        return DoorsPresent(columns, self._annotations)

    def names(self) -> dict[DoorId, str]:
        """Return the name of each door that has one, ids ascending."""
        named = (i for i in self._annotations.names() if i in self._places)
        return {i: name for i in named if (name := self[i].name)}

    def others_than(self, before: DoorsPresent) -> tuple[list[DoorId], list[DoorId]]:
        """Return the doors that are new or not as they were, and those that are gone.

        What is the same costs next to nothing: the columns are compared, and no door is made.
        """
        mine, theirs = self._columns["door_id"], before._columns["door_id"]
        common, at, there = np.intersect1d(mine, theirs, assume_unique=True, return_indices=True)
        differs = np.zeros(len(common), np.bool_)
        for name, column in self._columns.items():
            now, then = column[at], before._columns[name][there]
            differs |= (now != then) & ~((now != now) & (then != then))  # noqa: PLR0124 - NaN
        said, old = self._said(), before._said()
        told_anew = {i for i in said.keys() | old if said.get(i) != old.get(i)}
        changed = {*common[differs].tolist(), *np.setdiff1d(mine, theirs).tolist(), *told_anew}
        gone = np.setdiff1d(theirs, mine).tolist()
        return (
            [DoorId(i) for i in sorted(changed) if i in self._places],
            [DoorId(i) for i in gone],
        )

    def _said(self) -> Mapping[DoorId, object]:
        """Return what is said of each in words: its name and, where there are classes, what it is.

        Where there are none, no door is made for it.
        """
        if not self.classes:
            return self._annotations.names()
        return {i: (door.name, door.object_class, door.outline) for i, door in self.items()}

    def __repr__(self) -> str:
        return repr(self._all())

    def _all(self) -> dict[DoorId, Door]:
        if self._everything is None:
            names = list(self._columns)
            rows = zip(*(column.tolist() for column in self._columns.values()), strict=True)
            self._everything = {
                DoorId(door_id): self._door(dict(zip(names, row, strict=True)))
                for door_id, row in zip(self._ids, rows, strict=True)
            }
        return self._everything

    def _door(self, row: dict[str, Any]) -> Door:
        values = {name: row[name] for name in FIELDS}
        annotations = self._annotations.of(
            row["door_id"], (row["added_happened_ns"], row["added_event"])
        )
        return Door(
            door_id=DoorId(row["door_id"]),
            **values | {"state": DoorState.of(row["state"])},
            last_seen_ns=row["state_happened_ns"],
            last_event=row["last_event"],
            annotations=annotations,
            object_class=self.classes.get(annotations.get(CLASS, ""), DOOR),
        )
