"""Where a log's robot was last."""

from __future__ import annotations

from semmap_log.analysis.rooms import Place
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import RobotPose

_Stamped = tuple[int, Place] | None


class LastPoseProjection:
    """The fold: the robot's last place and when it was there; None before the first."""

    name = "last_pose"
    version = 1

    def initial(self) -> _Stamped:
        """Return no place."""
        return None

    def apply(self, state: _Stamped, batch: EventBatch, /) -> _Stamped:
        """Fold a batch in."""
        if RobotPose not in batch:
            return state
        times_ns = batch.folds_ns[batch.where(RobotPose)]
        latest = len(times_ns) - 1 - int(times_ns[::-1].argmax())
        if state is not None and times_ns[latest] < state[0]:
            return state
        row = batch[RobotPose][latest]
        place = Place(int(row["level"]), float(row["x"]), float(row["y"]))
        return int(times_ns[latest]), place
