"""What a patrol is to be like, and what was planned of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from semmap_log.analysis.planning.door_chances import SkipRule
from semmap_log.analysis.planning.learnt_chances import LONGEST_S
from semmap_log.analysis.planning.patrol_targets import NotVisited, WantedTarget
from semmap_log.analysis.rooms import Place
from semmap_log.analysis.rooms.walking import SPEED_M_S
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.errors import PlanError

ENTER_S, WAIT_S, LOOK_S = 17.0, 10.0, 3.0


@dataclass(frozen=True, slots=True)
class PatrolOptions:
    """What a round is like."""

    speed_m_s: float = SPEED_M_S
    budget_s: float | None = None
    enter_s: float = ENTER_S
    """To go in, look, and come out."""
    wait_s: float = WAIT_S
    """So long the robot waits at a door that is shut, after a look of 3 s."""
    asks: bool = False
    """The robot may ask for doors: P is that of passing, learnt from earlier tries."""
    skip: SkipRule = field(default_factory=SkipRule)


@dataclass(frozen=True, slots=True)
class PlannedStop:
    """A stop of the plan."""

    target: WantedTarget
    door: Door
    """By which to go in."""
    place: Place
    """Where to stand before it."""
    others: tuple[Door, ...]
    """To try if that is shut."""
    arrives_ns: int
    """On average."""
    p_passes: float
    """When one arrives."""
    low: float
    high: float
    """The 90 % interval's end."""
    is_known: bool
    """False: UNKNOWN; P is that of the others on average."""
    wait_s: float | None
    """Until it is open, on average, from the arrival on; None: not known."""
    why: str


@dataclass(frozen=True, slots=True)
class PatrolPlan:
    """A round, planned."""

    start_ns: int
    known_ns: int
    """What happened later does not count."""
    tz: str
    estimator: str
    options: PatrolOptions
    start: Place | None
    """None: nobody knows where the robot is; the round begins at its first stop."""
    stops: tuple[PlannedStop, ...]
    left_out: tuple[NotVisited, ...]
    mean_visit_s: float
    """Mean time to visit what lets the robot in, from the start on."""
    visits: float
    """How many of the stops let the robot in at their first door, on average."""
    notes: tuple[str, ...]
    """What must not be overlooked."""
    avoided: frozenset[DoorId] = frozenset()
    """Doors that are likely shut at the start: ways lead through them only if they must."""


def check_options(options: PatrolOptions) -> None:
    """Check that a round can be such.

    Raises:
        PlanError: A time is none.
    """
    if options.budget_s is not None and not (math.isfinite(options.budget_s)
                                             and options.budget_s > 0):  # fmt: skip
        raise PlanError(f"budget: expected a time above 0 s, got {options.budget_s:g} s.")
    for name, seconds in (("enter", options.enter_s), ("wait", options.wait_s)):
        if not (math.isfinite(seconds) and 0 <= seconds <= LONGEST_S):
            raise PlanError(f"{name}: expected 0 s to {LONGEST_S:g} s, got {seconds:g} s.")
