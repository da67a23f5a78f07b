"""Copies of commits that lack their first events: known from the same moment on, and as true."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import MAX_EVENT, DoorObserved, Event, RobotPose
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.importing.importing import import_file
from semmap_log.interop.pseudonyms.pseudonymous_log import pseudonymous
from semmap_log.log.trimming.redaction import Redaction, Tracks
from semmap_log.log.trimming.trim_log import trim_log
from semmap_log.store.reading.reader import LogReader
from tests.log.trimming.logs import SECOND_NS, MinuteClock
from tests.verbs import Verb

HOUR_NS = 3600 * SECOND_NS
DOOR = DoorId(1)


def log_without_poses(folder: Path, *events: Event) -> Path:
    """Return a log whose last commit lost two poses before these events."""
    log, clock = folder / "log", MinuteClock()
    poses = [RobotPose(x=float(i), y=0.0, theta=0.0, level=0) for i in range(2)]
    with sl.create(log, tz="UTC", clock=clock, compact=False) as writer:
        writer.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front")
        writer.append([*poses, *events])
    trim_log(log, Redaction([Tracks()], MAX_EVENT), writing={"clock": clock})
    return log


def seen(state: DoorState, at_ns: int | None = None) -> DoorObserved:
    return DoorObserved(door_id=DOOR, state=state, happened_ns=at_ns)


def imported(log: Path, folder: Path, run_verb: Verb) -> sl.DoorLog:
    lines = folder / "lines.jsonl"
    export(sl.read(log), lines)
    with sl.create(folder / "made", tz="UTC", compact=False) as made:
        import_file(made, lines)
    return sl.read(folder / "made")


def without_names(log: Path, folder: Path, run_verb: Verb) -> sl.DoorLog:
    with pseudonymous(sl.read(log)) as (copy, _):
        lines = folder / "lines.jsonl"
        export(copy, lines)
    with sl.create(folder / "made", tz="UTC", compact=False) as made:
        import_file(made, lines)
    return sl.read(folder / "made")


def joined(log: Path, folder: Path, run_verb: Verb) -> sl.DoorLog:
    other, clock = folder / "other", MinuteClock()
    clock.now_ns += HOUR_NS  # later than the log: the join numbers its door after that one's
    with sl.create(other, tz="UTC", clock=clock, compact=False) as writer:
        writer.add_door(x=9.0, y=2.0, theta=0.0, width=0.9, name="back")
    join, frames = folder / "house.join.json", [f"{each}=0,0,0" for each in ("log", "other")]
    done = run_verb("join", join, log, other, "--frame", frames[0], "--frame", frames[1])
    assert done[0] == 0, done
    return sl.read(join)


COPIES = [imported, without_names, joined]
Copy = Callable[[Path, Path, Verb], sl.DoorLog]


@pytest.mark.parametrize("copied", COPIES)
def test_a_commit_is_known_from_when_it_was_recorded(
    copied: Copy, tmp_path: Path, run_verb: Verb
) -> None:
    """
    Not from when the first event was that it still has.
    """
    log = log_without_poses(tmp_path, seen(DoorState.OPEN), seen(DoorState.CLOSED))
    (recorded_ns,) = (one.recorded_ns for one in LogReader(log).commits() if one.count == 4)

    made = copied(log, tmp_path, run_verb)

    for at_ns, state in ((recorded_ns - 1, DoorState.UNKNOWN), (recorded_ns, DoorState.CLOSED)):
        for one in (sl.read(log), made):
            assert one.replay(known_at=f"@{at_ns}").doors[DOOR].state is state


@pytest.mark.parametrize("copied", COPIES)
def test_a_sighting_dated_to_the_future_counts_after_the_same_ones(
    copied: Copy, tmp_path: Path, run_verb: Verb
) -> None:
    """
    It counts from when it was recorded: after a later one of the commit, which is dated now.
    """
    now_ns = MinuteClock().now_ns
    log = log_without_poses(
        tmp_path, seen(DoorState.OPEN, now_ns + HOUR_NS), seen(DoorState.CLOSED)
    )

    made = copied(log, tmp_path, run_verb)

    for one in (sl.read(log), made):
        assert one.replay().doors[DOOR].state is DoorState.OPEN
