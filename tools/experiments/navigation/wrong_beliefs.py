"""Where the map was wrong: the difference of a run's two logs, at a moment and over time."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from navigation.runs import Run
from semmap_log.core.folds.history import diff
from semmap_log.core.folds.timeline import Timeline
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import Moment


def wrong_doors(run: Run, at_ns: int) -> Collection[DoorId]:
    """Return the doors whose state in the map was not that in the world, at a moment."""
    at = Moment(ns=at_ns)
    changed = diff(run.world.replay(at=at), run.belief.replay(at=at)).changed
    return [change.door.door_id for change in changed if change.field == "state"]


def wrong_share(run: Run) -> float:
    """Return the mean share of doors that the map had wrong, over all time of the run."""
    world, belief = run.world.timelines(), run.belief.timelines()
    if not world:
        return 0.0
    span = run.begin_ns, run.end_ns
    wrong_ns = sum(_apart_ns(world[door], belief[door], *span) for door in world)
    return wrong_ns / (len(world) * max(1, span[1] - span[0]))


def _apart_ns(one: Timeline, other: Timeline, begin_ns: int, end_ns: int) -> int:
    """Return how long two lanes of states differ between two times."""
    cuts = np.unique(np.concatenate([one.start_ns, other.start_ns, [begin_ns, end_ns]]))
    cuts = cuts[(cuts >= begin_ns) & (cuts <= end_ns)]
    states = [
        lane.state[np.searchsorted(lane.start_ns, cuts[:-1], "right") - 1] for lane in (one, other)
    ]
    return int(np.diff(cuts)[states[0] != states[1]].sum())
