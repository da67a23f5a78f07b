"""What a visit to a door tells."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

from semmap_log.core.model.doors import DoorId, DoorState


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """A door was looked at for a while, from one robot, and this is what the scans say."""

    door_id: DoorId
    first_ns: int
    """Stamp of the first scan that saw the door."""
    last_ns: int
    scans: int
    state: DoorState
    """OPEN, CLOSED or UNKNOWN: undecided."""
    accuracy: float
    """P(this state is right), for both states alike: accuracy / (1 - accuracy) is the likelihood
    ratio of open to shut, free of any prior. 0.5 to 1."""
    opening: float
    """The clear share of the width that is expected, 0..1; NaN: nothing was seen of it."""
    ajar: float
    """P(neither shut nor open)."""
    looks: float
    """How many independent looks it is worth."""
    through: float
    """Looks that went through the line; the robot where it is believed to be."""
    stopped: float
    """Looks that ended on it."""
    behind_m: float
    """Where beams that ended within half a metre of the line ended, behind (+) or before (-) it, on
    average, m, square to it; NaN: none did. Of a door that is not shut it means nothing."""
    near: float = 0.0
    """How many looks that is."""
    passed: bool = False
    """The robot drove through."""
    p_open: float = nan
    """P(open | open or shut), before which both are alike; NaN: nothing was seen of it."""
    leaves: tuple[tuple[float, float, float, float], ...] = ()
    """How its leaves stand most likely: x, y of one end and of the other, m, frame `map`; none: out
    of sight."""
    why: str = ""
    """Why it is UNKNOWN, in a few words; empty: it is not."""
    laser: str = ""
    """Which of the robot's lasers saw most of it."""
    robot: str = ""
    side: int = 0
    """From where it was seen: 1 the left of its line, -1 the right, 0 both or not told."""
    told_ns: int = 0
    """When the same state was told from the same stand already; 0: it is news. See `stands`."""
