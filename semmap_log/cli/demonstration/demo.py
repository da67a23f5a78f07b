"""The main job in one go, on a shipped recording: record, replay, export, look.

The second half reads a bag of laser scans and compares the doors with the truth.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semmap_log.analysis.beliefs.door_beliefs import DoorBelief, probabilities
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.events import DoorObserved, DoorPassed, Retracted, RobotPose
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import LogExistsError, MissingExtraError, NotALogError
from semmap_log.interop.exporting.costmap_files import write_costmap
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.formats.json.door_json import event_to_json
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.importing.scan_topics import ScanOptions
from semmap_log.live.ros.line_recorder import LineAnswer, LineRecorder
from semmap_log.log import DoorLog, DoorLogWriter, Scope, create, read

SCANS = "office_scans"
VISIT_S = 10.0
"""A robot looks at a door for about so long; the sighting is of the end of that."""


@dataclass(frozen=True, slots=True)
class SeenDoor:
    """A door's state by the scans, and its real one."""

    name: str
    happened_ns: int
    said: str
    """OPEN or CLOSED."""
    accuracy: float
    passed: bool
    """The robot drove through."""
    truth: str
    """OPEN, AJAR or CLOSED; several, in order: it moved during the last `VISIT_S`."""


@dataclass(frozen=True, slots=True)
class SeenByLaser:
    """What the demo made of the bag."""

    log: Path
    doors: Sequence[SeenDoor]


def see_by_laser(folder: Path, recordings: Path, *, tz: str) -> SeenByLaser:
    """Make a log of the shipped bag: its doors, then what its scans say of them.

    Args:
        folder: Where to.
        recordings: Where the bag, its doors and its truth are.
        tz: The building's zone.
    """
    log = folder / SCANS
    with create(log, tz=tz, building="rmf_office") as writer:
        import_file(writer, recordings / f"{SCANS}.doors.jsonl")
        import_file(writer, recordings / f"{SCANS}.mcap", ImportOptions(scan=ScanOptions()))
    truth = json.loads((recordings / f"{SCANS}.truth.json").read_text(encoding="utf-8"))
    doors = {door["door_id"]: door for door in truth["doors"]}
    return SeenByLaser(log, _seen(read(log), doors, truth["start_ns"]))


def _seen(log: DoorLog, doors: dict[DoorId, Any], start_ns: int) -> list[SeenDoor]:
    found = []
    for entry in log.history():
        match entry.event:
            case DoorObserved() as event:
                said, accuracy, passed = event.state.name, event.accuracy_open, False
            case DoorPassed() as event:
                said, accuracy, passed = "OPEN", 1.0, True
            case _:
                continue
        door = doors[event.door_id]
        at_s = (entry.happened_ns - start_ns) / SECOND_NS
        truth = _truth(door["states"], at_s if passed else at_s - VISIT_S, at_s)
        found.append(SeenDoor(door["name"], entry.happened_ns, said, accuracy, passed, truth))
    return sorted(found, key=lambda seen: seen.happened_ns)


def _truth(rows: Sequence[dict[str, Any]], from_s: float, to_s: float) -> str:
    """Return how a door stood from one moment to another, in words."""
    from_s = max(from_s, 0.0)
    before = [row["state"] for row in rows if row["from_s"] <= from_s][-1:]
    later = [row["state"] for row in rows if from_s < row["from_s"] <= to_s]
    stood = [state for state in (*before, *later) if state != "MOVING"]
    return ", then ".join(stood) or "MOVING"


RECORDING = "office"
MOST_WAIT_S = 10.0
"""A line that is not answered by then never will be."""


@dataclass(frozen=True, slots=True)
class Demo:
    """What the demo made."""

    folder: Path
    log: Path
    yaml: Path
    costmap: Path
    report: Path
    rrd: Path | None
    """None: rerun is not installed."""
    rrd_problem: str
    copied: int
    """Events copied from the recording's first part."""
    recorded: int
    """Events recorded live."""
    moments: tuple[DoorMap, DoorMap, DoorMap]
    """The door map at the end of the first part, in the middle of the second, and at the end."""
    seen: SeenByLaser
    """Results of a laser's scans on another patrol, compared to the truth."""
    beliefs: Sequence[DoorBelief]
    """How likely each door was open in the middle of the second, from what was known then."""


def run_demo(folder: Path, *, tell: Callable[[str], None] = lambda _text: None) -> Demo:
    """Make a log from the shipped recording, as a patrol would, and look at it from all sides.

    Args:
        folder: Where to; a folder that does not exist, or is empty.
        tell: Called with a line of progress.

    Raises:
        LogExistsError: There is something in the folder already.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise LogExistsError(
            f"{folder}: there is something here already; name another folder: "
            f"{command_line('demo', 'OTHER')}"
        )
    source = read(shipped_recording(RECORDING))
    history = [entry for entry in source.history() if not _is_of_that_log_only(entry)]
    half = _middle(history)
    path = folder / RECORDING
    info = source.info
    clock = _RecordingClock()
    with create(
        path, tz=info.timezone, building=info.building, robot=info.robot, clock=clock
    ) as log:
        begin = counted(half, "event")
        tell(f"{path}: a new log; copying the first {begin} of the recording into it")
        _copy(log, history[:half], clock)
        tell(f"recording the other {len(history) - half}, one JSON line each, as `record` does")
        recorded = _record(log, history[half:], clock)
    made = read(path)
    moments = [history[i].happened_ns for i in (half - 1, (half + len(history)) // 2, -1)]
    first, middle, last = (made.replay(at=ns) for ns in moments)
    yaml = folder / "doors.yaml"
    export(made, yaml, default_prob=0.5)
    tell(f"{yaml}: the door database in the thesis's form")
    costmap = _costmap(made, folder / "costmap.png", middle.moment_ns)
    tell(f"{costmap}: the doors in the middle of it, as a robot's planner would see them")
    report = folder / "report.html"
    export(made, report)
    tell(f"{report}: the history as a page for any browser")
    tell(f"{folder / SCANS}: what a laser sees of the doors, from a bag of its scans")
    recordings = shipped_recording(RECORDING).parent
    seen = see_by_laser(folder, recordings, tz=info.timezone)
    rrd, problem = _rrd(made, folder / f"{RECORDING}.rrd")
    return Demo(
        folder=folder, log=path, yaml=yaml, costmap=costmap, report=report,
        rrd=rrd, rrd_problem=problem, copied=half, recorded=recorded,
        moments=(first, middle, last), seen=seen,
        beliefs=probabilities(made, at=middle.moment_ns),
    )  # fmt: skip


def shipped_recording(name: str) -> Path:
    """Return the folder of a recording that comes with this package.

    Raises:
        NotALogError: It is not there: the package was installed without its recordings.
    """
    package = Path(__file__).parents[2]
    for folder in (package / "recordings", package.parent / "recordings"):
        if (folder / name).is_dir():
            return folder / name
    raise NotALogError(f"the recording {name!r} is not here; install semmap-log from its sources.")


def _is_of_that_log_only(entry: HistoryEntry) -> bool:
    """Return whether an event makes sense only under the numbers that its own log gave."""
    return entry.retracted or isinstance(entry.event, Retracted)


def _middle(history: list[HistoryEntry]) -> int:
    """Return where the second half begins, at the border of a commit."""
    half = len(history) // 2
    while half < len(history) and history[half].command_id == history[half - 1].command_id:
        half += 1
    return half


class _RecordingClock:
    """A clock that returns when the recording recorded what is appended next.

    So the demo's log knows things when the recording knew them, and not all of them today.
    """

    boot_id = bytes(16)

    def __init__(self) -> None:
        self.now_ns = 0

    def wall_ns(self) -> int:
        return self.now_ns

    def monotonic_ns(self) -> int:
        return self.now_ns


def _copy(log: DoorLogWriter, entries: list[HistoryEntry], clock: _RecordingClock) -> None:
    """Append events commit by commit, with their notes, synced once at the end."""
    start = 0
    for i in range(1, len(entries) + 1):
        if i == len(entries) or entries[i].command_id != entries[start].command_id:
            first = entries[start]
            clock.now_ns = first.recorded_ns
            note = Note(first.actor, first.source, first.reason, first.correlation)
            log.append([entry.event for entry in entries[start:i]], note=note, sync=False)
            start = i
    log.sync()


def _record(log: DoorLogWriter, entries: list[HistoryEntry], clock: _RecordingClock) -> int:
    """Feed events as JSON lines through a pipe to what `record` runs, each at its own time."""
    reading, writing = os.pipe()
    answered = threading.Event()

    def feed() -> None:
        with os.fdopen(writing, "w", encoding="utf-8") as pipe:
            for entry in entries:
                answered.clear()
                clock.now_ns = entry.recorded_ns
                said = {"actor": entry.actor, "reason": entry.reason}
                pipe.write(json.dumps(event_to_json(entry.event, note=said)) + "\n")
                pipe.flush()
                if not isinstance(entry.event, RobotPose):  # a pose waits for what comes next
                    answered.wait(MOST_WAIT_S)

    problems: list[str] = []

    def answer(one: LineAnswer) -> None:
        answered.set()
        if one.error:
            problems.append(f"line {one.line}: {one.error}")

    recorder = LineRecorder(log, answer)
    feeder = threading.Thread(target=feed, daemon=True)
    feeder.start()
    try:
        recorder.run(reading)
    finally:
        os.close(reading)
        feeder.join()
    assert not problems, problems
    return recorder.recorded


def _costmap(log: DoorLog, path: Path, at_ns: int) -> Path:
    """Draw the costmap of a moment, with room for a robot as wide as a person."""
    options = CostmapOptions(inflate_m=0.55, inscribed_m=0.25)
    write_costmap(log, costmap_at(log, options, at=at_ns), path, scope=Scope(at_ns))
    return path


def _rrd(log: DoorLog, path: Path) -> tuple[Path | None, str]:
    from semmap_log.interop.formats.kept_scans.reading import kept_visits

    try:
        from semmap_log.views.rerun.recording import save_rrd

        save_rrd(log, path, scans=kept_visits)
    except MissingExtraError as error:
        return None, str(error)
    return path, ""
