"""What events do to doors, told once: the fields of a door, and which kind of event sets which.

A kind of event says in its `effect` what it does to its door (`events`). From these tables come the
fold (`folds.registers`), all columns of changes (`folds.door_changes`), evidence, JSON
lines, Arrow tables and imports: who adds a kind that sets a state, or a field of a door, tells it
here and in `events`, and nowhere else.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from enum import Enum, IntFlag
from functools import reduce
from operator import or_
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, TypeAlias

from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.doors import LEVEL_NOT_GIVEN, MAX_LEVEL, NAN, NO_LEVEL, DoorState
from semmap_log.core.model.rules import FINITE, Fit, Number, Whole, marks_of, rules_of


class Changed(IntFlag):
    """Which parts of a door a DoorUpdated sets."""

    POSE = 1
    """x, y, theta and level."""
    WIDTH = 2
    STATE = 4
    PROB_OPEN = 8
    PROB_CLOSED = 16


def sets_part(changed: Any, bit: int) -> Any:
    """Tell whether bits of `Changed` have one of them; or a column of bits, where."""
    return ((changed + 0) & bit) != 0  # + 0: a plain number, whose `&` takes a tenth of the time


def _half_given(x: Any, y: Any, theta: Any) -> Any:
    """Tell where some of a pose is NaN, and not all of it: an unplaced door has none."""
    lacks_x = x != x  # noqa: PLR0124 - NaN
    return (lacks_x != (y != y)) | (lacks_x != (theta != theta))  # noqa: PLR0124


def _lacks_pose(changed: Any, x: Any, y: Any, theta: Any) -> Any:
    """Tell where a pose is set, and some of it is NaN."""
    lacks = (x != x) | (y != y) | (theta != theta)  # noqa: PLR0124
    return lacks & sets_part(changed, _POSE_BIT)


_POSE_BIT = int(Changed.POSE)
_POSE = ("x", "y", "theta")

WHOLE_POSE = Fit("x", _POSE, _half_given, FINITE.expected, _POSE)
"""All of a pose is there, or nothing."""
POSE_IF_SET = Fit("x", ("changed", *_POSE), _lacks_pose, FINITE.expected, _POSE)
WIDTH_WITH_POSE = Fit(
    "width",
    ("x", "width"),
    lambda x, width: (x != x) != (width != width),  # noqa: PLR0124 - NaN
    "a width where there is a pose, and none where there is none",
    ("width",),
)

LevelNumber: TypeAlias = Annotated[
    int, Whole(0, MAX_LEVEL, absent=NO_LEVEL, absent_value=LEVEL_NOT_GIVEN)
]
PlaceOrNone: TypeAlias = Annotated[float, Number(or_nan=True)]
Probability: TypeAlias = Annotated[float, Number(0, 1, or_nan=True)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoorValues:
    """The fields of a door that events set, each with the part of the door that it belongs to."""

    __slots__ = ()
    fits: ClassVar[tuple[Fit, ...]] = (WHOLE_POSE,)

    level: Annotated[LevelNumber, Changed.POSE] = LEVEL_NOT_GIVEN
    """Not given: the one that the door is on; of a new door the log's only one: see `levels`."""
    x: Annotated[PlaceOrNone, Changed.POSE] = NAN
    y: Annotated[PlaceOrNone, Changed.POSE] = NAN
    theta: Annotated[PlaceOrNone, Changed.POSE] = NAN
    width: Annotated[float, Number(0, or_nan=True, unit="metres", if_set=True), Changed.WIDTH] = NAN
    state: Annotated[DoorState, Changed.STATE] = DoorState.UNKNOWN
    prob_open: Annotated[Probability, Changed.PROB_OPEN] = NAN
    prob_closed: Annotated[Probability, Changed.PROB_CLOSED] = NAN


PART_OF: Mapping[str, Changed] = marks_of(DoorValues, Changed)
"""Field -> the part that it belongs to."""

FIELDS: Mapping[str, str] = {name: rule.dtype for name, rule in rules_of(DoorValues).items()}
"""Every field of a door that events set -> its numpy type."""

PARTS: Mapping[Changed, Mapping[str, str]] = {
    bit: {name: FIELDS[name] for name, part in PART_OF.items() if part == bit} for bit in Changed
}
"""Part of a door -> its fields and their numpy types. The fields of a part are set together."""

ALL_CHANGED = reduce(or_, PARTS)
NOTHING = Changed(0)

PLACING = Changed.POSE | Changed.WIDTH
"""What an update must set together to give a door its first place."""

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
    values: Mapping[str, int] = dataclasses.field(default_factory=lambda: MappingProxyType({}))
    """Fields of the door that it sets always to the same."""
    presence: Presence = Presence.STAYS
    is_sighting: bool = False
    """Somebody saw it: evidence that may be wrong, and says nothing of the time until the next."""

    @property
    def can_set(self) -> Changed:
        """The parts that such an event may set."""
        return ALL_CHANGED if self.says_what else self.sets


NO_EFFECT = Effect()
