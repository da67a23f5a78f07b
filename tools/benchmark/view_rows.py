"""Rerun's own way: a call for each row, as its examples do it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from semmap_log.core.batches.event_batch import RecordedEvent
    from semmap_log.log.door_log.door_log import DoorLog


def log_rows(log: DoorLog, rrd: Path, count: int) -> None:
    """Write the first events as rows: states, lines, poses, probabilities and text."""
    import rerun as rr

    recording = rr.RecordingStream("semmap_log", recording_id=log.info.log_id)
    recording.save(rrd)
    for batch in log.batches(until=f"event:{count}"):
        for recorded in batch:
            happened_ns = min(recorded.happened_ns, recorded.recorded_ns)
            recording.set_time("happened", timestamp=np.datetime64(happened_ns, "ns"))
            recording.set_time("recorded", timestamp=np.datetime64(recorded.recorded_ns, "ns"))
            recording.set_time("event", sequence=recorded.number)
            _log_row(rr, recording, recorded)
    recording.flush()
    recording.disconnect()


def _log_row(rr: Any, recording: Any, recorded: RecordedEvent) -> None:
    from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorUpdated, RobotPose
    from semmap_log.views.event_words import words_of

    event = recorded.event
    match event:
        case RobotPose():
            recording.log("/map/robot/pose", rr.Arrows2D(
                origins=[[event.x, event.y]], vectors=[[np.cos(event.theta), np.sin(event.theta)]]
            ))  # fmt: skip
            return
        case DoorAdded():
            line = rr.LineStrips2D([[[event.x, event.y], [event.x + event.width, event.y]]])
            recording.log(f"/map/doors/door_{event.door_id}", line)
            recording.log(
                f"/map/doors/door_{event.door_id}", rr.StateChange(state=event.state.name)
            )
        case DoorObserved():
            recording.log(
                f"/map/doors/door_{event.door_id}", rr.StateChange(state=event.state.name)
            )
        case DoorUpdated():
            recording.log(f"/map/doors/door_{event.door_id}/p", rr.Scalars(event.prob_open))
    recording.log(f"/events/{type(event).__name__}", rr.TextLog(words_of(event)))
