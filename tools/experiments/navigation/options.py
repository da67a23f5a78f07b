"""What a run is made with: numbers of the world, of the robot, and of the thesis's programs."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from navigation.door_daemon import READINGS


class OptionError(ValueError):
    """A number that no run can be made with."""


@dataclass(frozen=True)
class RunOptions:
    """All that a run depends on beside its building, setup, series and seed."""

    goals: int = 100
    """So many must be reached."""
    near_m: float = 3.0
    """StageDoorSensor: a door is near within this distance of its line (the thesis gives none)."""
    notices: float = 0.9
    """StageDoorSensor: P(it notices that map and world differ), at each look."""
    sense_m: float = 8.0
    """Range of the laser: it marks and clears that far."""
    noise_m: float = 0.02
    """Standard deviation of a range."""
    clears_beyond: bool = False
    """A beam that meets nothing within the range clears, too (`inf_is_valid`)."""
    recovery_clears: bool = False
    """Recovery forgets the obstacle layer around the robot (`clear_costmap_recovery`)."""
    margin_m: float = 0.0
    """The local planner gives up before a goal with less room than this beside the robot."""
    base: float = 0.02
    """DoorDaemon: base probability of a toggle (the thesis gives none)."""
    reading: str = "prose"
    """DoorDaemon: which reading of the thesis's sentence; see `door_daemon`."""
    every_s: float = 900.0
    """DoorDaemon: between two iterations."""
    rejected_within_s: float = 20.0
    """GoalSender: a goal given up later than this was given up "after driving"."""
    window: int = 10
    """Setups that choose: so many goals are known at a time."""
    most_tries: int = 20_000
    """A run ends here, however few goals were reached."""

    def __post_init__(self) -> None:
        """Refuse what makes no sense.

        Raises:
            OptionError: Which number, what was expected, and what it is.
        """
        if self.reading not in READINGS:
            known = " or ".join(READINGS)
            raise OptionError(f"reading: expected {known}, got {self.reading!r}")
        for name in ("goals", "window", "most_tries"):
            if getattr(self, name) < 1:
                raise OptionError(f"{name}: expected 1 or more, got {getattr(self, name)}")
        for name in ("notices", "base"):
            if not 0 <= getattr(self, name) <= 1:
                raise OptionError(f"{name}: expected 0 to 1, got {getattr(self, name):g}")
        for name in ("near_m", "noise_m", "margin_m", "rejected_within_s"):
            if not 0 <= getattr(self, name) < math.inf:
                raise OptionError(f"{name}: expected 0 or more, got {getattr(self, name):g}")
        for name in ("sense_m", "every_s"):
            if not 0 < getattr(self, name) < math.inf:
                raise OptionError(f"{name}: expected more than 0, got {getattr(self, name):g}")

    def changed(self) -> dict[str, object]:
        """Return what is not as usual, by name."""
        usual = asdict(RunOptions())
        return {name: value for name, value in asdict(self).items() if usual[name] != value}
