"""A run of the experiment as two logs: how the doors were, and what the robot believed and did.

    OUT/BUILDING/SETUP/SERIES-SEED/world     every change of a door
    OUT/BUILDING/SETUP/SERIES-SEED/belief    sightings, poses, and each goal as a round

The same calls give the same bytes. A run that was not closed leaves nothing with its name.
"""

from __future__ import annotations

import json
import math
import random
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from navigation.simulated_log import SimulatedLog
from semmap_log.core.model.doors import LEVEL_NOT_GIVEN, DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorUpdated,
    Event,
    LevelAdded,
    PatrolFinished,
    PatrolStarted,
    RobotPose,
)
from semmap_log.core.model.moments import parse_instant

if TYPE_CHECKING:
    from typing_extensions import Self

START_NS = parse_instant("2026-01-05T00:00Z", tz="UTC")
"""When every run begins: second 0."""
PROGRAM = "navigation_experiment"
"""Who wrote the first commit, whose note holds the run's parameters."""
STEP_M, TURN = 0.25, math.radians(15)
"""A pose is kept if the robot moved so far, or turned so much, since the last one kept."""

Json = str | int | float | bool | None | Sequence["Json"] | Mapping[str, "Json"]


class RunError(Exception):
    """A run's logs are not what a run leaves, or are there already."""


class Outcome(str, Enum):
    """How a goal ended."""

    REACHED = "reached"
    REJECTED = "rejected"
    """It was planned as unreachable: the robot was told so before it drove."""
    AFTER_DRIVING = "after_driving"
    """It was given up later: the robot had to drive to find its way blocked."""
    UNFINISHED = "unfinished"
    """The run was over before it: no goal of the tables."""


@dataclass(frozen=True, order=True)
class RunKey:
    """Which run it is: also the folder that it lies in."""

    building: str
    """`clinic`, or with what was swept: `clinic,near_m=1`."""
    setup: str
    series: str
    """`random` or `fixed`."""
    seed: int

    def __post_init__(self) -> None:
        """Refuse a key that cannot be a folder.

        Raises:
            RunError: A name is empty or has a separator in it; a seed below 0.
        """
        for name in ("building", "setup", "series"):
            text = getattr(self, name)
            if not text or "/" in text or text.startswith("."):
                raise RunError(f"{name} of a run: expected a name for a folder, got {text!r}.")
        if self.seed < 0:
            raise RunError(f"seed of a run: expected 0 or more, got {self.seed}.")

    def folder(self, out: Path) -> Path:
        """Return where its logs lie below a folder."""
        return out / self.building / self.setup / f"{self.series}-{self.seed}"

    def making(self, out: Path) -> Path:
        """Return where its logs lie while it is made."""
        folder = self.folder(out)
        return folder.with_name(f".making_{folder.name}")

    @classmethod
    def of(cls, folder: Path) -> RunKey:
        """Return which run lies in a folder, by the folder's name.

        Raises:
            RunError: Its name is not that of a run.
        """
        series, _, seed = folder.name.rpartition("-")
        if not seed.isdecimal():
            raise RunError(f"{folder}: expected a folder BUILDING/SETUP/SERIES-SEED.")
        return cls(folder.parent.parent.name, folder.parent.name, series, int(seed))


class RunRecorder:
    """Writes the two logs of a run. Times are seconds since its start, and never run backwards."""

    def __init__(
        self,
        out: Path,
        key: RunKey,
        plan: Sequence[Event],
        parameters: Mapping[str, Json],
        *,
        states: Mapping[DoorId, DoorState],
        believed: Mapping[DoorId, DoorState] | None = None,
    ) -> None:
        """Begin a run; it takes its name when it is closed.

        Args:
            out: The folder of all runs.
            key: Which run it is.
            plan: The events that both logs begin with: what the import of a building's level
                gives (its level, floor map, doors and their names).
            parameters: All that the run was made with, for the note of the first commit.
            states: How the doors stand at second 0; of a door that is left out, as planned.
            believed: How the map has them; default: the same.

        Raises:
            RunError: The run is there already.
        """
        self.folder = key.folder(out)
        if self.folder.exists():
            raise RunError(f"{self.folder}: the run is there already; remove it to run it again.")
        self._making = key.making(out)
        shutil.rmtree(self._making, ignore_errors=True)  # what a killed run left
        self._making.mkdir(parents=True)
        told = json.dumps({**asdict(key), **parameters}, sort_keys=True)
        entropy = random.Random(told)
        levels = [event.level for event in plan if isinstance(event, LevelAdded)]
        self._level = levels[0] if len(levels) == 1 else LEVEL_NOT_GIVEN
        logs = {"world": states, "belief": states if believed is None else believed}
        self._world, self._belief = (
            SimulatedLog(self._making / name, key.building, key.setup, entropy, START_NS)
            for name in logs
        )
        for log, stand in zip((self._world, self._belief), logs.values(), strict=True):
            log.add(*(_standing(event, stand) for event in plan))
            log.commit(actor=PROGRAM, reason=told)
        self._place: dict[str, Json] = {}
        self._now_s = 0.0
        self._last: tuple[float, float, float] | None = None

    def door_changed(self, t: float, door: DoorId, state: DoorState) -> None:
        """Record that a door of the world opened or closed."""
        now_ns = self._ns(t)
        if now_ns != self._world.now_ns:
            self._world.commit(actor="door_daemon")
        self._world.add(
            DoorUpdated(happened_ns=now_ns, door_id=door, changed=Changed.STATE, state=state)
        )

    def sighted(
        self,
        t: float,
        door: DoorId,
        state: DoorState,
        *,
        accuracy: float = 1.0,
        source: str = "door_sensor",
    ) -> None:
        """Record that the robot's map was told how a door stands.

        Args:
            t: When.
            door: Which.
            state: OPEN or CLOSED.
            accuracy: P(what is told is right).
            source: Who told it: the robot's `door_sensor`, a `smart_door`.
        """
        self._commit_goal()
        self._belief.add(
            DoorObserved(
                happened_ns=self._ns(t), door_id=door, state=state, accuracy_open=accuracy,
                accuracy_closed=accuracy,
            )
        )  # fmt: skip
        self._belief.commit(source=source)

    def pose(self, t: float, x: float, y: float, theta: float) -> None:
        """Record where the robot is, unless it has hardly moved since the last pose kept."""
        now_ns = self._ns(t)
        if self._last is not None:
            last_x, last_y, last_theta = self._last
            turned = abs((theta - last_theta + math.pi) % math.tau - math.pi)
            if math.hypot(x - last_x, y - last_y) < STEP_M and turned < TURN:
                return
        self._last = (x, y, theta)
        self._belief.add(RobotPose(happened_ns=now_ns, level=self._level, x=x, y=y, theta=theta))

    def goal_sent(self, t: float, number: int, x: float, y: float, *, kind: str = "") -> None:
        """Record that the robot was told to go somewhere.

        Args:
            t: When.
            number: Of the goal, once a run.
            x: Where, m, frame `map`.
            y: Where.
            kind: What is there, such as `free` or `occupied`.
        """
        self._commit_goal()
        self._belief.add(PatrolStarted(happened_ns=self._ns(t), patrol=number))
        self._place = {"x": float(x), "y": float(y), "kind": kind}

    def goal_ended(
        self, t: float, number: int, outcome: Outcome | str, figures: Mapping[str, Json]
    ) -> None:
        """Record how a goal ended.

        Args:
            t: When.
            number: As it was sent.
            outcome: One of `Outcome`.
            figures: What else is known of it, such as `planned_s`, `drove_s`, `path_m`.
        """
        ended = Outcome(outcome).value
        self._belief.add(PatrolFinished(happened_ns=self._ns(t), patrol=number))
        self._place |= {"outcome": ended, **dict(sorted(figures.items()))}
        self._commit_goal()

    def _commit_goal(self) -> None:
        """Write what waits of a goal; one that ended before anything was seen is one commit."""
        if self._place:
            self._belief.commit(actor="goal_sender", reason=json.dumps(self._place))
            self._place = {}

    def close(self) -> Path:
        """Write what waits, and give the run its name; return its folder."""
        self._world.close(actor="door_daemon")
        self._commit_goal()
        self._belief.close(actor="robot")
        self._making.rename(self.folder)
        return self.folder

    def discard(self) -> None:
        """Leave nothing of the run."""
        for log in (self._world, self._belief):
            log.close()
        shutil.rmtree(self._making)

    def _ns(self, t: float) -> int:
        """Return the moment that a second of the run is.

        Raises:
            RunError: Time ran backwards.
        """
        if not t >= self._now_s:
            raise RunError(f"{self.folder}: second {t} comes after second {self._now_s}.")
        self._now_s = t
        return START_NS + round(t * 1e9)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()


def _standing(event: Event, states: Mapping[DoorId, DoorState]) -> Event:
    """Return an event of the plan, a door with the state that it has at the start."""
    if isinstance(event, DoorAdded) and event.door_id in states:
        return replace(event, happened_ns=START_NS, state=states[event.door_id])
    return replace(event, happened_ns=START_NS)
