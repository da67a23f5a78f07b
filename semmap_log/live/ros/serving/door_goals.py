"""The thesis's goals as they are meant: fields that count, checked, before anybody acts on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, TypeAlias

from semmap_log.core.model.doors import (
    MAX_DOOR_ID,
    NAN,
    THESIS_STATES,
    DoorId,
    DoorState,
    thesis_state,
)
from semmap_log.errors import InvalidEventError
from semmap_log.live.ros.ros_node import Values

Place: TypeAlias = tuple[float, float, float]
"""x, y (metres) and theta (radians), frame `map`."""


@dataclass(frozen=True, slots=True)
class AddAsk:
    """A door is to come into the map."""

    place: Place
    width: float
    state: DoorState
    prob_open: float
    """NaN: not given."""
    prob_closed: float


@dataclass(frozen=True, slots=True)
class UpdateAsk:
    """Values of a door are to be set; None: that one is to stay as it is."""

    door_id: DoorId
    place: Place | None
    width: float | None
    state: DoorState | None
    prob_open: float | None
    prob_closed: float | None


@dataclass(frozen=True, slots=True)
class RemoveAsk:
    """A door is to leave the map."""

    door_id: DoorId


@dataclass(frozen=True, slots=True)
class SaveAsk:
    """The doors are to be written to a file."""

    file_name: str


Ask: TypeAlias = AddAsk | UpdateAsk | RemoveAsk | SaveAsk


def read_goal(action: str, values: Values) -> tuple[Ask, list[str]]:
    """Return what a goal asks for, and what is odd about it.

    Args:
        action: Its type without the package, such as `AddDoor`.
        values: Its fields; those left out have ROS's defaults.

    Raises:
        InvalidEventError: A field that counts has a value that no door can have.
    """
    fields = _Fields(values, [])
    return _READERS[action](fields), fields.warnings


@dataclass(frozen=True, slots=True)
class _Fields:
    """Takes values out of a goal, and notes what is odd about them."""

    values: Mapping[str, Any]
    warnings: list[str]

    def add(self) -> AddAsk:
        return AddAsk(
            self.place(),
            self.width(),
            self.state(),
            self.probability("prob_open"),
            self.probability("prob_closed"),
        )

    def update(self) -> UpdateAsk:
        return UpdateAsk(
            self.door_id(),
            self.place() if self.is_set("change_pos") else None,
            self.width() if self.is_set("change_width") else None,
            self.state() if self.is_set("change_open") else None,
            self.new_probability("prob_open"),
            self.new_probability("prob_closed"),
        )

    def remove(self) -> RemoveAsk:
        return RemoveAsk(self.door_id())

    def save(self) -> SaveAsk:
        return SaveAsk(str(self.values.get("file_name", "")))

    def is_set(self, name: str) -> bool:
        return bool(self.values.get(name, False))

    def number(self, name: str) -> float:
        return float(self.values.get(name, 0.0))

    def door_id(self) -> DoorId:
        """Return the id: the goal's field has 64 bits, an id 32."""
        door_id = int(self.values.get("door_id", 0))
        if not 0 <= door_id <= MAX_DOOR_ID:
            _refuse("door_id", f"a whole number from 0 to {MAX_DOOR_ID}", door_id)
        return DoorId(door_id)

    def place(self) -> Place:
        for name in ("pos_x", "pos_y", "pos_theta"):
            if not math.isfinite(self.number(name)):
                unit = "radians" if name == "pos_theta" else "metres"
                _refuse(name, f"a finite number of {unit}", self.number(name))
        return self.number("pos_x"), self.number("pos_y"), self.number("pos_theta")

    def width(self) -> float:
        width = self.number("width")
        if not (math.isfinite(width) and width >= 0):
            _refuse("width", "a finite number of metres, 0 or more", width)
        return width

    def state(self) -> DoorState:
        """Return the state, in any case of letters; a text that is none is UNKNOWN (4.2.2)."""
        text = str(self.values.get("door_state", ""))
        known = thesis_state(text)
        if known is None:
            self.warnings.append(
                f"door_state: expected one of {', '.join(THESIS_STATES)}, got {text!r}; "
                "taken for UNKNOWN."
            )
        return DoorState.UNKNOWN if known is None else known

    def probability(self, name: str) -> float:
        value = self.number(name)
        if math.isnan(value):
            return NAN
        if not 0 <= value <= 1:
            _refuse(name, "a number from 0 to 1, or NaN where none is given", value)
        return value

    def new_probability(self, name: str) -> float | None:
        """Return what a probability is to become.

        NaN is not given, and what is not given stays: a mean of no sightings, 0/0, must not wipe
        out what is known.
        """
        if not self.is_set(f"change_{name}"):
            return None
        value = self.probability(name)
        if math.isnan(value):
            self.warnings.append(f"{name}: NaN means not given; it stays as it is.")
            return None
        return value


_READERS: Mapping[str, Callable[[_Fields], Ask]] = {
    "AddDoor": _Fields.add,
    "UpdateDoor": _Fields.update,
    "RemoveDoor": _Fields.remove,
    "SaveDoorDB": _Fields.save,
}


def _refuse(name: str, expected: str, got: object) -> NoReturn:
    raise InvalidEventError(name, expected, got)
