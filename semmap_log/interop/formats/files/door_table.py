"""What a file of doors holds, whatever its format: values with their lines, for `importing`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from semmap_log.core.model.doors import NAN, DoorId, DoorState, Level
from semmap_log.core.model.events import FloorMap


@dataclass(frozen=True, slots=True)
class TableDoor:
    """A door as a file describes it."""

    line: int
    """Where in the file, 1-based."""
    door_id: DoorId | None
    """None: the format has no numbers; its name and level say which door it is."""
    level: int
    """The number of one of the table's levels; 0 where the format has none."""
    x: float
    y: float
    theta: float
    width: float
    state: DoorState | None = None
    """None: the file does not say."""
    prob_open: float = NAN
    """NaN: the file does not say."""
    prob_closed: float = NAN
    annotations: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TablePlace:
    """A point of a level that has a name."""

    name: str
    level: int
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class DoorTable:
    """All that was read from a file of doors."""

    path: Path
    doors: tuple[TableDoor, ...]
    levels: tuple[Level, ...] = ()
    """Numbered from 1 on, lowest first; the log may number them otherwise."""
    floor_maps: tuple[FloorMap, ...] = ()
    left_out: tuple[str, ...] = ()
    """What the file holds and the log cannot, in words."""
    warnings: tuple[str, ...] = ()
    """What was read, but perhaps not as meant."""
    places: tuple[TablePlace, ...] = ()
    """Points with names: what rooms are called in which they lie."""
