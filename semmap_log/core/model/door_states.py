"""The states of a door, and what the thesis's formats know of them."""

from __future__ import annotations

from enum import IntEnum


class DoorState(IntEnum):
    """What a door is known to be; 5..255 are reserved."""

    UNKNOWN = 0
    OPEN = 1
    CLOSED = 2
    MOVING = 3
    OFFLINE = 4

    def __str__(self) -> str:
        return self.name

    @classmethod
    def parse(cls, text: str) -> DoorState:
        """Return the state of that name, in any case of letters.

        Raises:
            ValueError: The text is none of the five names.
        """
        try:
            return cls[text.strip().upper()]
        except KeyError:
            names = " ".join(state.name for state in cls)
            raise ValueError(f"expected one of {names}, got {text!r}") from None

    @classmethod
    def of(cls, number: int) -> DoorState:
        """Return the state of that number; one that only a later version knows is UNKNOWN."""
        return cls._value2member_map_.get(number, cls.UNKNOWN)  # type: ignore[return-value]

    @property
    def is_known(self) -> bool:
        """True for OPEN and CLOSED: the states that a map, a YAML or a belief can use."""
        return self in (DoorState.OPEN, DoorState.CLOSED)


THESIS_STATES = {state.name: state for state in (DoorState.OPEN, DoorState.CLOSED,
                                                 DoorState.UNKNOWN)}  # fmt: skip
"""The states that the thesis's formats know: its YAML, its DoorMap, the goals of its actions."""


def thesis_state(text: str) -> DoorState | None:
    """Return the state of that name, in any case of letters; None: the thesis knows none such.

    Its server takes such a text for UNKNOWN (4.2.2).
    """
    return THESIS_STATES.get(text.strip().upper())


def reduced(state: DoorState) -> DoorState:
    """Return the state as the thesis's formats know it: all but OPEN and CLOSED are UNKNOWN."""
    return state if state.is_known else DoorState.UNKNOWN
