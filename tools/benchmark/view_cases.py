"""Cases: a log written as a recording for rerun, and opened."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmark.case import Case, Peer, Work
from benchmark.logs import Workshop
from benchmark.peers import OURS
from benchmark.rounds import Rounds

if TYPE_CHECKING:
    from semmap_log.core.batches.event_batch import RecordedEvent
    from semmap_log.log.door_log.door_log import DoorLog


TIMELINES = ("happened", "recorded", "event")
STATE, CLEAR, ROW = "StateChange:state", "Clear:is_recursive", "rerun.controls.RowId"

States = list[dict[int, str]]
"""Door -> state, at some moments along some timelines."""


def states_of(path: Path, numbers: Sequence[int], timelines: Sequence[str] = TIMELINES) -> States:
    """Return what replays give where these events stand."""
    import semmap_log as sl

    log = sl.read(path)
    scopes = {"happened": "at", "recorded": "known_at", "event": "event"}
    found = []
    for timeline in timelines:
        for number in numbers:
            how: dict[str, Any] = {scopes[timeline]: _place(log, number, timeline)}
            doors = log.replay(**how).doors
            found.append({int(door_id): door.state.name for door_id, door in doors.items()})
    return found


def states_in(
    rrd: Path, log: DoorLog, numbers: Sequence[int], timelines: Sequence[str] = TIMELINES
) -> States:
    """Return what a viewer would show there: of each door the latest state, if it is not gone."""
    rows = _door_rows(rrd)
    found = []
    for timeline in timelines:
        for number in numbers:
            at = _place(log, number, timeline)
            states = {door: _latest(told, timeline, at) for door, told in rows.items()}
            found.append({door: state for door, state in sorted(states.items()) if state})
    return found


def shape_of(rrd: Path) -> tuple[int, int]:
    """Return the rows of the longest chunk, and how many chunks there are."""
    from rerun.chunk import RrdReader

    rows = [chunk.num_rows for chunk in RrdReader(rrd).stream()]
    return max(rows), len(rows)


def _place(log: DoorLog, number: int, timeline: str) -> int:
    recorded = log.event(number)
    if timeline == "happened":
        return min(recorded.happened_ns, recorded.recorded_ns)
    return recorded.recorded_ns if timeline == "recorded" else number


Told = list[tuple[dict[str, Any], Any, list[str | None]]]
"""Chunk by chunk: times along each timeline, row ids, states; None: it vanishes."""


def _door_rows(rrd: Path) -> dict[int, Told]:
    from rerun.chunk import RrdReader

    found: dict[int, Told] = {}
    for chunk in RrdReader(rrd).stream().filter(content="/map/doors/**"):
        if chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        names = batch.schema.names
        component = STATE if STATE in names else CLEAR if CLEAR in names else None
        if component is None:
            continue
        times = {name: np.array(batch.column(name).cast("int64")) for name in chunk.timeline_names}
        told = batch.column(component).to_pylist()
        states = [one[0] if one and component == STATE else None for one in told]
        door = int(chunk.entity_path.rsplit("_", 1)[1])
        found.setdefault(door, []).append((times, batch.column(ROW).to_pylist(), states))
    return found


def _latest(told: Told, timeline: str, at: int) -> str | None:
    best: tuple[int, Any] = (-1, b"")
    state = None
    for times, rows, states in told:
        if timeline not in times:
            continue
        place = int(np.searchsorted(times[timeline], at, "right")) - 1
        if place >= 0 and (here := (int(times[timeline][place]), rows[place])) > best:
            best, state = here, states[place]
    return state


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


SIZES = ((Rounds(100_000, 133), 4_000, 300), (Rounds(1_000_000, 500), 40_000, 400))
"""A log; how many ms it may take; how many MB of memory."""
TRIED_OUT = ((Rounds(300, 5), 4_000, 300), (Rounds(600, 10), 40_000, 400))
SLOW_EVENTS = 3_000
"""Rerun's own way, row by row, gets so many events from the log's beginning."""
MOMENTS = 5
OPENED_MS = 5_000
MB = 10**6


def view_cases(shop: Workshop, rounds: int | None, *, tries_out: bool = False) -> Iterator[Case]:
    """Yield: a log of 100,000 events into .rrd; one of a million; the viewer opening that.

    Args:
        shop: Where the logs are made.
        rounds: Rounds that count; None: one.
        tries_out: Only small logs, and no viewer, to see whether everything works.
    """
    recording = Path()
    for made, most_ms, most_mb in TRIED_OUT if tries_out else SIZES:
        folder = shop.folder_for(f"view_{made.events}")
        shop.say(f"writing {made.events:,} events of {made.doors} doors")
        made.write(folder / "log")
        recording = folder / "ours.rrd"
        yield _conversion(folder, made, most_ms, most_mb, rounds)
    if not tries_out:
        yield _opening(recording, shop.folder_for("view_none"), rounds)


def _conversion(folder: Path, made: Rounds, most_ms: int, most_mb: int, rounds: int | None) -> Case:
    few = min(SLOW_EVENTS, made.events)
    numbers = [made.doors + (made.events - 1 - made.doors) * i // MOMENTS
               for i in range(1, MOMENTS + 1)]  # fmt: skip
    log = folder / "log"
    peers = (
        Peer(OURS, partial(_ours, log, folder / "ours.rrd", numbers), states_of(log, numbers),
             promise=f"< {most_ms} ms"),
        Peer(f"rr.log, {few / made.events:.1%} of it",
             partial(_row_by_row, log, folder / "slow.rrd", few),
             states_of(log, [few - 1], timelines=["event"]), units=few / made.events),
    )  # fmt: skip
    title = f"{made.events:,} events of {made.doors} doors into .rrd"
    return Case("view", title, "ms", peers, rounds or 1, memory_mb=most_mb, warms_up=False)


def _ours(path: Path, rrd: Path, numbers: list[int]) -> Work:
    import semmap_log as sl
    from semmap_log.views.rerun import recording  # noqa: F401 - loads rerun: not timed
    from semmap_log.views.rerun.recording import RrdSummary, save_rrd

    def answer(_: RrdSummary) -> States:
        return states_in(rrd, sl.read(path), numbers)

    def note(summary: RrdSummary) -> str:
        most, chunks = shape_of(rrd)
        return (f"{summary.bytes / MB:.1f} MB, {chunks:,} chunks of at most {most:,} rows, "
                f"{summary.left_out}")  # fmt: skip

    return Work(lambda _: save_rrd(sl.read(path), rrd), answer=answer, note=note)


def _row_by_row(path: Path, rrd: Path, count: int) -> Work:
    import semmap_log as sl

    def once(_: None) -> None:
        log_rows(sl.read(path), rrd, count)

    def answer(_: None) -> States:
        return states_in(rrd, sl.read(path), [count - 1], timelines=["event"])

    def note(_: None) -> str:
        return f"{rrd.stat().st_size / MB:.1f} MB for {count:,} events"

    return Work(once, answer=answer, note=note)


def _opening(recording: Path, folder: Path, rounds: int | None) -> Case:
    peers = (
        Peer(OURS, partial(_opened, recording), True, promise=f"< {OPENED_MS} ms"),
        Peer("a recording of one door", partial(_opened_small, folder / "door"), True),
    )  # fmt: skip
    return Case("view", "Rerun's viewer starts and opens it", "ms", peers, rounds or 3,
                has_memory=False)  # fmt: skip


def _opened(recording: Path) -> Work:
    from semmap_log.views.rerun.process import ViewerError, headless

    def once(_: None) -> bool:
        with headless(recording) as viewer:
            return not any(view.reports for view in viewer.state().views)

    try:
        once(None)
    except ViewerError as error:
        if "graphics driver" in str(error):
            raise ModuleNotFoundError(name="a graphics driver") from None
        raise
    return Work(once)


def _opened_small(folder: Path) -> Work:
    import semmap_log as sl
    from semmap_log.views.rerun.recording import save_rrd

    with sl.create(folder, tz="UTC") as log:
        log.add_door()
    recording = folder.with_suffix(".rrd")
    save_rrd(sl.read(folder), recording)
    return _opened(recording)
