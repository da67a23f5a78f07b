"""Events as lines of text: when, which door, what; who and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import Changes, Stamp
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorEvent, Event, Retracted, RobotPose
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.meaning import NO_EFFECT, PLACING, Presence
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.core.model.object_classes import DOOR
from semmap_log.views.event_words import state_told_by, words_of
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.rerun.drawable import drawable
from semmap_log.views.rerun.scene import Scene, SceneDoor
from semmap_log.views.rerun.thinning import RepeatFinder, is_long
from semmap_log.views.zone_times import MS_NS, Span, from_utc, zone_offsets

if TYPE_CHECKING:
    from semmap_log.core.model.commits import Commit

INFO, WARN, DEBUG = "INFO", "WARN", "DEBUG"
"""INFO: the map is another than before; WARN: look here; DEBUG: it stayed as it was."""

LAST_NUMBER = 2**63


@dataclass(frozen=True, slots=True)
class EventLine:
    """One event in words."""

    number: int
    folds_ns: int
    recorded_ns: int
    kind: int
    importance: str
    """INFO, WARN or DEBUG."""
    text: str
    state: DoorState | None
    """The state that the event gives to its door, for the line's colour; None: none."""


class EventLines:
    """Puts events into words; remembers each door's state, to tell changes from repeats."""

    def __init__(self, scene: Scene, excerpt: Excerpt, commits: Iterable[Commit]) -> None:
        self._scene = scene
        self._excerpt = excerpt
        self._repeats = RepeatFinder(scene.doors) if is_long(scene) else None
        self._notes = _Notes(commits)
        self._clock = LocalClock(excerpt.log.info.timezone)
        self._has_offsets = len(offsets_in(scene, excerpt.log.info.timezone)) > 1
        edges = self._shown(np.array([scene.begin.folds_ns, scene.end.folds_ns]))
        self._time_from = len("2026-") if edges[0][:4] == edges[1][:4] else 0
        self._states: dict[int, tuple[int, DoorState]] = {
            door_id: (-1, door.before.state)
            for door_id, door in scene.doors.items()
            if door.before is not None
        }
        self.left_out = 0
        """Sightings so far that have no line: they repeat a state."""

    def of(self, batch: EventBatch, changes: Changes) -> Iterator[EventLine]:
        """Yield a line for each event but the robot's poses, and repeats in a long recording.

        Args:
            batch: Events; batches come in order.
            changes: What they do to doors.
        """
        told = batch.select((batch.kind != RobotPose.kind) & ~self._is_repeat(batch, changes))
        folds_ns = told.folds_ns
        times = self._shown(folds_ns)
        offsets = self._offsets(folds_ns) if self._has_offsets else [""] * len(times)
        taken_back = self._excerpt.is_retracted(told.number)
        rows = zip(told, folds_ns.tolist(), times, offsets, taken_back.tolist(), strict=True)
        for recorded, t, time, offset, is_void in rows:
            event, number = recorded.event, recorded.number
            importance, said, state = self._what(event, (t, number), is_void=is_void)
            when = time[self._time_from :].replace("T", " ") + offset
            text = f"{when}  {said}{self._notes.of(number)}"
            yield EventLine(number, t, recorded.recorded_ns, event.kind, importance, text, state)

    def _shown(self, times_ns: NDArray[np.int64]) -> list[str]:
        """Return what the clocks of the building show then: `2026-03-01T14:02:00`."""
        seconds = times_ns // SECOND_NS
        wall = (seconds + self._clock.offset_s(seconds)).astype("M8[s]")
        shown: list[str] = np.datetime_as_string(wall, unit="s").tolist()
        return shown

    def _offsets(self, times_ns: NDArray[np.int64]) -> list[str]:
        """Return how far those clocks are ahead of UTC then: ` UTC+2`."""
        return [f" {from_utc(s)}" for s in self._clock.offset_s(times_ns // SECOND_NS).tolist()]

    def _is_repeat(self, batch: EventBatch, changes: Changes) -> NDArray[np.bool_]:
        if self._repeats is None:
            return np.zeros(len(batch), np.bool_)
        repeats = self._repeats.numbers(changes)
        self.left_out += len(repeats)
        return np.isin(batch.number, repeats)

    def _what(
        self, event: Event, stamp: Stamp, *, is_void: bool
    ) -> tuple[str, str, DoorState | None]:
        """Return importance, words and state."""
        known = self._scene.doors.get(event.door_id) if isinstance(event, DoorEvent) else None
        said = drawable(words_of(event, DOOR if known is None else known.shape.object_class))
        if is_void:
            said = f"{said} (taken back later)"
        if not isinstance(event, DoorEvent):
            return WARN if isinstance(event, Retracted) else INFO, said, None
        door = self._scene.doors.get(event.door_id)
        if door is None:
            return DEBUG, f"door {event.door_id}  {said} (not in the map)", None
        said = f"{_who(door)}  {said}"
        if is_void:
            return INFO, said, state_told_by(event)
        goes = event.effect.presence is Presence.GOES
        if not (goes or door.life.added <= stamp < door.life.removed):
            return DEBUG, f"{said} (not in the map then)", None
        state = state_told_by(event)
        return self._importance(event, state, stamp), said, state

    def _importance(self, event: DoorEvent, state: DoorState | None, stamp: Stamp) -> str:
        is_news = self._remember(event, state, stamp)
        effect, sets = event.effect, event.sets()
        if effect.presence is Presence.GOES or (effect.only_if and not sets):
            return WARN
        if effect.presence is Presence.COMES or effect is NO_EFFECT:
            return INFO
        return INFO if is_news or sets & PLACING else DEBUG

    def _remember(self, event: DoorEvent, state: DoorState | None, stamp: Stamp) -> bool:
        """Keep the door's state; return whether it is another than before."""
        if state is None:
            return False
        latest_ns, known = self._states.get(event.door_id, (-1, None))
        if stamp[0] < latest_ns:
            return event.effect.presence is Presence.COMES  # a late event: the map has moved on
        self._states[event.door_id] = stamp[0], state
        return state != known


def offsets_in(scene: Scene, tz: str) -> list[str]:
    """Return how far a zone's clocks are ahead of UTC within what a scene shows: `UTC+1`."""
    span = Span(scene.begin.folds_ns // MS_NS, scene.end.folds_ns // MS_NS)
    return list(dict.fromkeys(from_utc(offset_s) for _, offset_s in zone_offsets(span, tz)))


def _who(door: SceneDoor) -> str:
    """Return the door's name and id: the id is what the plan and the command line know."""
    own = f"door {door.door_id}"
    return own if door.label == own else f"{door.label} #{door.door_id}"


class _Notes:
    """Who and why, from the commits, for event numbers that only ascend."""

    def __init__(self, commits: Iterable[Commit]) -> None:
        self._commits = iter(commits)
        self._end = 0
        self._text = ""

    def of(self, number: int) -> str:
        """Return the note of that event's commit, as the tail of a line; empty: none."""
        while number >= self._end:
            commit = next(self._commits, None)
            if commit is None:
                self._end, self._text = LAST_NUMBER, ""
            else:
                self._end = commit.first_event + commit.count
                parts = [part for part in (commit.note.actor, commit.note.reason) if part]
                self._text = f"  · {drawable(': '.join(parts))}" if parts else ""
        return self._text
