"""What events say about how doors are: stretches in which a state is known, and sightings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorId

Times = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class DoorEvidence:
    """What is known of a door up to `until_ns`."""

    door_id: DoorId
    until_ns: int
    start_ns: Times
    """(m,), ascending: when stretches begin in which the state is known all through."""
    end_ns: Times
    """(m,): when they end; <= the next one's start."""
    is_open: NDArray[np.bool_]
    """(m,): their state."""
    seen_ns: Times
    """(k,), ascending: sightings, outside of the stretches or at their edges."""
    llr: NDArray[np.float64]
    """(k,): what each adds to log P(what was read | open) / P(... | closed), in nats: a visit's
    sightings sum up to their mean, so that a hundred in one pass are as good as one."""
    accuracy_open: NDArray[np.float64]
    """(k,): P(reads open | open) of the sensor."""
    accuracy_closed: NDArray[np.float64]
    """(k,): P(reads closed | closed)."""
    reads_open: NDArray[np.bool_]
    """(k,): what it read."""
    is_visit: NDArray[np.bool_]
    """(k,): the first sighting of a pass; the others of it add no visit."""
