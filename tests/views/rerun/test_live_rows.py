"""A log that was followed: what has arrived is what a file of it, written at the end, shows."""

from __future__ import annotations

import os
import random
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorRemoved,
    DoorUpdated,
    Event,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
)
from semmap_log.views.rerun import live_view as live
from semmap_log.views.rerun.live_view import LiveViewOptions, follow_in_viewer
from semmap_log.views.rerun.process import running
from semmap_log.views.rerun.recording import save_rrd
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START, Drawn, restless_log, room, wild_log

pytestmark = pytest.mark.viewer

ARRIVES_S = 120.0
MOST_COMMITS = 90
LAST_LOOKS = 4
"""So often the log is looked at once nothing more comes: to find it, to send it, to begin anew."""

FRONT = DoorId(1)
OPENS = DoorObserved(door_id=FRONT, state=DoorState.OPEN)
CLOSES = DoorObserved(door_id=FRONT, state=DoorState.CLOSED)
EARLY_NS = START + SECOND

COMMITS: dict[str, list[list[Event]]] = {
    "sightings": [[OPENS], [CLOSES, OPENS], [CLOSES]],
    "a robot on the plan": [[RobotPose(x=x, y=0.0, theta=0.0)] for x in (0.0, 0.5, 1.0)],
    "a robot off the plan": [[RobotPose(x=x, y=0.0, theta=0.0)] for x in (0.0, 90.0)],
    "probabilities": [
        [DoorUpdated(door_id=FRONT, changed=Changed.PROB_OPEN, prob_open=p)] for p in (0.2, 0.7)
    ],
    "a late sighting": [
        [OPENS], [DoorObserved(door_id=FRONT, state=DoorState.UNKNOWN, happened_ns=EARLY_NS)],
    ],
    "what is taken back": [[OPENS], [Retracted(first_event=2, last_event=2)], [CLOSES]],
    "a new door": [[DoorAdded(door_id=DoorId(2), x=1.0, y=1.0, theta=0.0, width=1.0)], [OPENS]],
    "a new name": [[DoorAnnotated(door_id=FRONT, key="name", value="back")], [OPENS]],
    "a place": [[DoorUpdated(door_id=FRONT, changed=Changed.POSE, x=2.0, y=2.0, theta=1.0)]],
    "a removal": [[OPENS], [DoorRemoved(door_id=FRONT)]],
    "a round": [[PatrolStarted(patrol=1)], [OPENS], [PatrolFinished(patrol=1)]],
}  # fmt: skip
GO_ON = {"sightings", "a place"}
"""The others change what is drawn once, or what was drawn already."""


@dataclass
class Growing:
    """A log that gets its commits one by one, each time that it is looked at."""

    path: Path
    commits: list[tuple[int, Sequence[Event]]]
    """When, and what."""
    clock: SteadyClock = field(default_factory=lambda: SteadyClock(START))
    looks_left: int = LAST_LOOKS
    replaced: list[str] = field(default_factory=list)
    """Ids of recordings that another one took the place of."""

    def follow(self, rrd: Path) -> Drawn:
        """Follow it until all has come; rerun writes what it is sent into a file."""
        with (
            sl.append(self.path, clock=self.clock) as writer,
            running(["--save", str(rrd)], os.environ) as rerun,
        ):
            rerun.wait_for("listen", rerun.is_listening, most_s=ARRIVES_S)
            follow_in_viewer(
                sl.read(self.path), rerun.url, LiveViewOptions(beliefs=False),
                stop=lambda: self._look(writer), forget=self.replaced.append,
            )  # fmt: skip
            self._wait_until_written(rrd)
        return self._drawn(rrd)

    def _wait_until_written(self, rrd: Path) -> None:
        """Rerun has taken all, and writes it from a thread of its own: some time it is there."""
        wanted = in_a_file(self, rrd.parent)
        deadline = time.monotonic() + ARRIVES_S
        while time.monotonic() < deadline:
            with suppress(Exception):  # half a file is whatever it is
                if self._drawn(rrd).shows() == wanted:
                    return
            time.sleep(0.2)

    def _drawn(self, rrd: Path) -> Drawn:
        turns = len(self.replaced)
        return Drawn(rrd, sl.read(self.path).info.log_id + (f"-{turns}" if turns else ""))

    def _look(self, writer: sl.DoorLogWriter) -> bool:
        """Add the next commit; tell whether there was none for a while."""
        if self.commits:
            self.clock.now_ns, events = self.commits.pop(0)
            writer.append(list(events))
            return False
        self.looks_left -= 1
        return self.looks_left < 0


@pytest.fixture(autouse=True)
def looks_follow_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "POLL_S", 0.001)


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
@pytest.mark.parametrize("name", COMMITS)
def test_what_comes_is_shown_as_a_file_would(name: str, tmp_path: Path) -> None:
    """Whether it became some more rows, or the recording began anew."""
    growing = Growing(tmp_path / "log", [])
    with sl.create(growing.path, tz="UTC", clock=growing.clock) as writer:
        writer.append([room()])
        writer.append([DoorAdded(door_id=FRONT, x=0.0, y=0.0, theta=0.0, width=1.0)])
    for minute, events in enumerate(COMMITS[name], start=1):
        growing.commits.append((START + 60 * minute * SECOND, events))

    drawn = growing.follow(tmp_path / "sent.rrd")

    assert (name not in GO_ON) == bool(growing.replaced)
    assert in_a_file(growing, tmp_path) == drawn.shows()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:RRD file has no footer")
@pytest.mark.parametrize(("make", "seed"), [(restless_log, 0), (wild_log, 1)])
def test_whatever_comes_is_shown_as_a_file_would(
    make: Callable[..., sl.DoorLog], seed: int, tmp_path: Path
) -> None:
    """Along all three timelines: late events, removals, moves, commits of many, much taken back."""
    source = make(tmp_path / "source", seed=seed)
    rng = random.Random(seed)
    commits = list(_commits(source))[:MOST_COMMITS]
    known = rng.randrange(10, 40)
    growing = Growing(tmp_path / "log", commits[known:])
    with sl.create(growing.path, tz="UTC", clock=growing.clock) as writer:
        for growing.clock.now_ns, events in commits[:known]:
            writer.append(events)

    drawn = growing.follow(tmp_path / "sent.rrd")

    assert in_a_file(growing, tmp_path) == drawn.shows()


def in_a_file(
    growing: Growing, tmp_path: Path
) -> dict[tuple[str, str, str], list[tuple[int, str]]]:
    """Return what a recording of the log shows that is made now."""
    save_rrd(sl.read(growing.path), tmp_path / "made.rrd", beliefs=False)
    return Drawn(tmp_path / "made.rrd").shows()


def _commits(log: sl.DoorLog) -> Iterator[tuple[int, list[Event]]]:
    """Yield when each commit was made, and its events."""
    for commit in log.commits():
        told = [log.event(n) for n in range(commit.first_event, commit.first_event + commit.count)]
        yield told[0].recorded_ns, [each.event for each in told]
