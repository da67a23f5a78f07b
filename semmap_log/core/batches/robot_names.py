"""The robots that a log names: one, or those whose logs were joined in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import RobotPose

BETWEEN_ROBOTS = ", "
AFTER_ROBOT = "/"
"""Between a robot and what its own log says of a source: `tug1/camera`."""


def robots_of(robot: str) -> tuple[str, ...]:
    """Return the robots that the `robot` of a log names: several where logs were joined."""
    return tuple(robot.split(BETWEEN_ROBOTS))


def robots_of_poses(batch: EventBatch, robots: Sequence[str]) -> NDArray[np.intp]:
    """Return, for each pose of a batch, the place of its robot among some; 0 if it names none."""
    if len(robots) < 2 or RobotPose not in batch:
        return np.zeros(len(batch.where(RobotPose)), np.intp)
    places, sources = batch.sources(RobotPose)
    known = {name: place for place, name in enumerate(robots)}
    of_source = [known.get(source.partition(AFTER_ROBOT)[0], 0) for source in sources]
    return np.array(of_source, np.intp)[places]
