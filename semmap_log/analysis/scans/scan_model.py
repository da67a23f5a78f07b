"""What is known beforehand of the laser, of the robot's place and of what lies around doors."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanModel:
    """The numbers of the beam model and of a visit; lengths m, angles rad, times s."""

    sd_range: float = 0.02
    """Noise of a range."""
    sd_xy: float = 0.05
    """Of the laser's place along each axis, where the scan does not tell."""
    sd_theta: float = radians(1.0)
    """Of its heading, where the scan does not tell."""
    least_sd_xy: float = 0.02
    least_sd_theta: float = radians(0.3)
    """Told standard deviations below these are not believed."""
    sd_door: float = 0.04
    """Of a leaf's place against the map: recesses, mouldings, the drawing."""

    reach: float = 6.0
    """Doors whose middle is farther away are not judged."""
    least_off: float = 0.30
    """Nearer to the door's line the laser sees it edge on."""
    flattest: float = radians(25.0)
    """Angle between beam and line below which a beam is not used: flatter ones end on the frame."""
    margin: float = 0.10
    """Of the line at both ends: taken by the frame."""
    beams: int = 12
    """Used of one door in one scan, evenly spaced."""
    tolerance: float = 0.15
    """A beam that ends so near to the line ended on it."""
    deep: float = 0.5
    """Behind the line by more a beam ended in the room, whatever the pose."""
    beside: float = 0.7
    """So far from its ends the wall beside a door is looked at."""
    beside_beams: int = 4
    """Used of the wall at each end."""

    short: float = 0.15
    """P(something stands in front)."""
    stray: float = 0.03
    """P(a range that means nothing): mixed pixels."""
    through_leaf: float = 0.01
    """P(a beam passes a leaf)."""
    through_glass: float = 0.6
    """The same of a glass door."""
    lost: float = 0.05
    """P(no return) of what is in range."""
    room: float = 3.0
    """Mean depth of what lies behind a door."""
    before: float = 0.15
    """A leaf nearer to the robot than the line by more looks like anybody who stands there ..."""
    persuades: float = 0.4
    """... and counts for so much less."""
    blurred: float = 0.08
    """A leaf's ends are known so well at best: nearer to them a beam may meet it, or may not."""
    wall_in_line: float = 0.7
    """P(the wall beside a door is in its line)."""
    wall_there: float = 0.6
    """P(a beam beside the door ends on the wall, if it is in line)."""

    cell: float = 0.10
    """Beams nearer to each other on the line count once."""
    looks_a_scan: float = 4.0
    """What a scan is worth at most."""
    step: float = 0.25
    """A scan this far from the last one is new altogether; nearer ones are worth less."""
    still_s: float = 120.0
    """A robot that stands gets one new scan's worth in this time."""
    least_fresh: float = 0.45
    """Scans are left out until one is worth this much ..."""
    least_often_s: float = 2.0
    """... or the last that was looked at is this old."""
    most_looks: float = 20.0
    """What a visit can be worth, however much it saw."""
    pause_s: float = 10.0
    """A visit ends this long after the door was last seen ..."""
    longest_s: float = 30.0
    """... or this long after it was first seen."""
    stand: float = 0.5
    """A laser that is no farther from where it was stands."""
    same_again_s: float = 1800.0
    """From one stand the same state of a door is told again after this time: a patrol's pace."""

    enough: float = 0.7
    """Looks through the line, or on it, that a word needs."""
    most_deep: float = 0.3
    """CLOSED needs that fewer looks went deep, as a share of those that ended on the line."""
    least_seen: float = 0.2
    """Share of the beams of a scan towards the door that come as far: fewer are strays, and the
    door is out of sight."""
    most_hidden: float = 0.8
    """Share of the beams towards the door that something before it stopped: more, and what the
    others met is as likely its edge as the door."""
    least_accuracy: float = 0.8
    """Below it nothing is said."""
    most_ajar_shut: float = 0.5
    most_ajar_open: float = 0.125
    """P(ajar) above which CLOSED, or OPEN, is not said."""
    lapse: float = 0.008
    """P(the visit means nothing at all): a wrong map, another door, glass that nobody told of."""
    passed_accuracy: float = 0.999
    """Of OPEN, where the robot drove through."""


DEFAULT = ScanModel()
