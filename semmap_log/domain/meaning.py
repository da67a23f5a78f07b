"""What events do to doors, told once: the parts of a door, and which kind of event sets which.

A kind of event says in its `effect` what it does to its door (`events`). From these tables come the
fold (`folds.registers`), all columns of changes (`folds.door_changes`), evidence, JSON
lines, Arrow tables and imports: who adds a kind that sets a state, or a field of a door, tells it
here and in `events`, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum, IntFlag
from functools import reduce
from operator import or_
from types import MappingProxyType


class Changed(IntFlag):
    """Which parts of a door a DoorUpdated sets."""

    POSE = 1
    """x, y, theta and level."""
    WIDTH = 2
    STATE = 4
    PROB_OPEN = 8
    PROB_CLOSED = 16


PARTS: Mapping[Changed, Mapping[str, str]] = {
    Changed.POSE: {"level": "u2", "x": "f8", "y": "f8", "theta": "f8"},
    Changed.WIDTH: {"width": "f8"},
    Changed.STATE: {"state": "u1"},
    Changed.PROB_OPEN: {"prob_open": "f8"},
    Changed.PROB_CLOSED: {"prob_closed": "f8"},
}
"""Part of a door -> its fields and their numpy types. The fields of a part are set together."""

ALL_CHANGED = reduce(or_, PARTS)
NOTHING = Changed(0)

PLACING = Changed.POSE | Changed.WIDTH
"""What an update must set together to give a door its first place."""

FIELDS: Mapping[str, str] = {name: dtype for part in PARTS.values() for name, dtype in part.items()}
"""Every field of a door that events set -> its numpy type."""

PART_OF: Mapping[str, Changed] = {name: bit for bit, part in PARTS.items() for name in part}
"""Field -> the part that it belongs to."""


REGISTERS: Mapping[str, Mapping[str, str]] = {
    "added": {},
    "removed": {},
    **{(bit.name or "").lower(): fields for bit, fields in PARTS.items()},
}
"""Register of a door -> its values and their numpy types. A stamp belongs to each: when what set
it last happened, and the number of that event."""

REGISTER_OF: Mapping[Changed, str] = dict(zip(PARTS, list(REGISTERS)[2:], strict=True))
"""Part of a door -> its register."""


def changed(names: Iterable[str]) -> Changed:
    """Return the parts to which fields of these names belong; other names count for nothing."""
    return reduce(or_, (PART_OF[name] for name in names if name in PART_OF), NOTHING)


class Presence(Enum):
    """What an event says about whether its door is in the map."""

    STAYS = 0
    COMES = 1
    GOES = 2


@dataclass(frozen=True, slots=True)
class Effect:
    """What events of a kind do to the door that they are about."""

    sets: Changed = NOTHING
    """The parts that every such event sets. One without a field of that name has it in `values`."""
    says_what: bool = False
    """Which parts it sets, each event says itself, in its field `changed`."""
    only_if: str = ""
    """A field that is true or false; where it is false, the event sets nothing."""
    values: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    """Fields of the door that it sets always to the same."""
    presence: Presence = Presence.STAYS
    is_sighting: bool = False
    """Somebody saw it: evidence that may be wrong, and says nothing of the time until the next."""

    @property
    def can_set(self) -> Changed:
        """The parts that such an event may set."""
        return ALL_CHANGED if self.says_what else self.sets


NO_EFFECT = Effect()
