"""The thesis's server without ROS: goals in, outcomes out, each goal one commit of the log.

An outcome is returned once its commit lasts as the log's durability promises. Goals that come
together share their syncs. A goal is known by its id: sent again, after a crash of either side,
it is answered as the first time.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from semmap_log import errors
from semmap_log.core.folds.levels import resolve_level
from semmap_log.core.model import events as ev
from semmap_log.core.model.commits import Note, content_of
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.core.model.meaning import Changed
from semmap_log.live.ros.ros_node import Goal, Outcome
from semmap_log.live.ros.serving import saving
from semmap_log.log import DoorLogWriter

ACTIONS = ("AddDoor", "UpdateDoor", "RemoveDoor", "SaveDoorDB")

SAVED_FORMAT = "thesis YAML"

RESULTS: Mapping[str, tuple[str, Any]] = {
    "AddDoor": ("door_id", 0),
    "UpdateDoor": ("door_updated", False),
    "RemoveDoor": ("door_removed", False),
    "SaveDoorDB": ("stored_successful", False),
}
"""Action -> the field of its result, and what it says where nothing was done."""


class DoorServer:
    """A log that is written by goals; may be used by several threads."""

    def __init__(
        self,
        open_log: Callable[[], DoorLogWriter],
        saver: saving.DoorSaver,
        *,
        level: str | None = None,
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        """Open the log.

        Args:
            open_log: Opens it, now and again after a write that failed.
            saver: Writes the files of SaveDoorDB.
            level: Number or name: where doors come that goals add; None: the only one.
            changed: Called after each commit, and when the log was reopened.

        Raises:
            LogError: As `open_log`.
        """
        self._open_log = open_log
        self._saver = saver
        self._level = level
        self._changed = changed
        self._opening = threading.Lock()
        self._log = open_log()
        self._broken: errors.LogPoisonedError | None = None
        """Why the log that is open cannot be written, if it could not be reopened."""
        self._is_closed = False

    @property
    def log(self) -> DoorLogWriter:
        """The log as it is open now."""
        return self._log

    def door_map(self) -> DoorMap:
        """Return the doors after the last commit."""
        return self._log.door_map()

    def floor_of(self, doors: DoorMap, level: int) -> ev.FloorMap | None:
        """Return the floor plan that a level has in one of its door maps; None: it has none."""
        return self._log.floor_of(doors, level)

    def run(self, goal: Goal) -> Outcome:
        """Do what a goal asks for, and return what became of it."""
        work = _Work(goal)
        try:
            ask, work.said[:] = saving.read_goal(goal.action, goal.values)
            work.result = self._do(work, ask)
        except (errors.SemmapError, OSError) as error:
            return work.outcome(succeeded=False, text=str(error))
        with suppress(Exception):  # who does not hear of the progress must still hear the result
            goal.feedback(100.0)
        return work.outcome(succeeded=True)

    def append(
        self,
        make: Callable[[DoorLogWriter], list[ev.Event]],
        *,
        note: Note,
        command_id: bytes,
        content: bytes,
        lost: Callable[[], str] = lambda: "Nothing of it is stored",
    ) -> int | None:
        """Append what `make` gives, as one durable commit; if a write fails, reopen the log.

        Args:
            make: Looks at the log and gives the events; nobody appends in between. Not called for
                a command that is stored already.
            note: Who, with what, why.
            command_id: 16 bytes; a command that is stored already is not stored again.
            content: Digest of what the command asks for.
            lost: Returns what became of it if the log was reopened and does not have it.

        Returns:
            The number of its first event; None: it needed none.

        Raises:
            CommandError: It is not stored; the message says why.
            LogError: Whether it is stored is not known.
        """
        log = self._usable_log()
        try:
            appended = log.append_made(
                lambda: make(log), note=note, command_id=command_id, content=content
            )
        except errors.LogPoisonedError as error:
            return self._after_failure(log, command_id, error, lost)
        if appended is None:
            return None
        if not appended.repeated:
            self._changed()
        return appended.first_event

    def close(self) -> None:
        """Close the log; goals that come later are aborted."""
        with self._opening:
            self._is_closed = True
            self._log.close()

    def _do(self, work: _Work, ask: saving.Ask) -> Any:
        """Return the result's value, once the request is done and durable.

        Raises:
            SemmapError: It is not done; the message says why.
        """
        try:
            first = self.append(
                lambda log: work.remember(self._events(log, work, ask)),
                note=work.note,
                command_id=work.goal.goal_id,
                content=content_of(work.goal.action, ask),
                lost=work.lost,
            )
        except errors.CommandReusedError as error:
            raise errors.CommandReusedError(f"goal id {work.goal.raw_goal_id}: {error}") from None
        if first is None:
            return True
        if not isinstance(ask, saving.AddAsk):
            return True
        added = work.events[0] if work.events else self._log.event(first).event
        assert isinstance(added, ev.DoorAdded), "it is what the goal became"
        return int(added.door_id)

    def _usable_log(self) -> DoorLogWriter:
        """Return the log; reopen it if the last try to do so failed.

        Raises:
            LogPoisonedError: It fails again.
        """
        if self._broken is not None:
            with self._opening:
                if self._broken is not None and not self._is_closed:
                    self._reopen(self._broken)
        return self._log

    def _after_failure(
        self,
        failed: DoorLogWriter,
        command_id: bytes,
        error: errors.LogPoisonedError,
        lost: Callable[[], str],
    ) -> int:
        """Reopen the log, and return the first event of a command whose write failed.

        Raises:
            LogError: The log cannot be opened; whether the goal is stored is not known.
            CommandError: It is not stored.
        """
        with self._opening:
            if self._log is failed and not self._is_closed:
                self._reopen(error)
        known = self._log.find_command(command_id)
        if known is None:
            raise errors.CommandError(
                f"the log could not be written: {_why(error)}. {lost()}; send it again when the "
                "disk is well."
            )
        return known.first_event

    def _reopen(self, error: errors.LogPoisonedError) -> None:
        with suppress(errors.LogPoisonedError):  # it was; the lock is let go of all the same
            self._log.close()
        self._broken = error
        try:
            self._log = self._open_log()
        except (errors.SemmapError, OSError) as another:
            raise errors.LogPoisonedError(
                f"the log could not be written: {_why(error)}; nor be opened again: {another} "
                "Whether this goal is stored is not known; send it again with the same id."
            ) from error
        self._broken = None
        self._changed()

    def _events(self, log: DoorLogWriter, work: _Work, ask: saving.Ask) -> list[ev.Event]:
        """Return what a goal means for the log as it stands; the log is held meanwhile."""
        happened_ns = when_ns(log)
        if isinstance(ask, saving.AddAsk):
            level = resolve_level(self._level, log.state.door_map())
            return [_added(ask, log.door_index.next_free_id, level, happened_ns)]
        if isinstance(ask, saving.UpdateAsk):
            return _updated(ask, _known_door(log, ask.door_id), happened_ns)
        if isinstance(ask, saving.RemoveAsk):
            _known_door(log, ask.door_id)
            return [ev.DoorRemoved(door_id=ask.door_id, happened_ns=happened_ns)]
        return [self._saved(ask, log, work, happened_ns)]

    def _saved(
        self, ask: saving.SaveAsk, log: DoorLogWriter, work: _Work, happened_ns: int | None
    ) -> ev.Event:
        """Write the file, and return the event that says so; no commit comes in between."""
        left_out = self._saver.save(ask.file_name, log.state.door_map())
        work.result = True  # whatever becomes of the commit
        work.said += [f"left out: {text}." for text in left_out]
        at_ns = log.now_ns() if happened_ns is None else happened_ns
        return ev.LogExported(
            format=SAVED_FORMAT, file_name=ask.file_name, at_ns=at_ns, happened_ns=happened_ns
        )


@dataclass(slots=True)
class _Work:
    """A goal while it is worked on."""

    goal: Goal
    said: list[str] = field(default_factory=list)
    """Warnings."""
    events: list[ev.Event] = field(default_factory=list)
    """What it means for the log."""
    result: Any = None
    """The result's value; None: nothing was done."""

    def remember(self, events: list[ev.Event]) -> list[ev.Event]:
        """Keep the events that are about to be appended, and return them."""
        self.events = events
        return events

    def lost(self) -> str:
        """Return what became of it where the log does not have it."""
        if self.result:
            return "The file is written, but the log has no note of it"
        return "Nothing of this goal is stored"

    @property
    def note(self) -> Note:
        """Who wants it: the client, by the goal's id as people and tools write it."""
        return Note(
            actor=self.goal.caller,
            source=f"action {self.goal.action}",
            correlation=self.goal.raw_goal_id,
        )

    def outcome(self, *, succeeded: bool, text: str = "") -> Outcome:
        name, nothing = RESULTS[self.goal.action]
        value = nothing if self.result is None else self.result
        said = " ".join([*([text] if text else []), *self.said])
        return Outcome(succeeded, {name: value}, said)


def when_ns(log: DoorLogWriter) -> int | None:
    """Return when a command of now happens; None: when it is recorded.

    Where the clock went back, that would be before what happened last, and the map would stay as
    it was, contrary to the client's answer. So the event gets that time.
    """
    latest_ns = log.state.latest_happened_ns
    return latest_ns if latest_ns > log.now_ns() else None


def _known_door(log: DoorLogWriter, door_id: DoorId) -> Door:
    known = log.state.door(door_id)
    if known is not None:
        return known
    if door_id in log.state.used_door_ids:
        raise errors.DoorRemovedError(
            f"door_id: door {door_id} was removed; ids are never used twice."
            f"{log.door_index.way_back(door_id)}"
        )
    raise errors.UnknownDoorError(f"door_id: door {door_id} is not in the map.")


def _added(
    ask: saving.AddAsk, door_id: DoorId, level: int, happened_ns: int | None
) -> ev.DoorAdded:
    x, y, theta = ask.place
    return ev.DoorAdded(
        door_id=door_id,
        level=level,
        x=x,
        y=y,
        theta=theta,
        width=ask.width,
        state=ask.state,
        prob_open=ask.prob_open,
        prob_closed=ask.prob_closed,
        happened_ns=happened_ns,
    )


def _updated(ask: saving.UpdateAsk, known: Door, happened_ns: int | None) -> list[ev.Event]:
    """Return what is to be set: the values that differ, if any does."""
    if not known.is_placed and (ask.place is None) != (ask.width is None):
        raise errors.CommandError(
            f"door {known.door_id} has no place yet; to place it, set change_pos and "
            "change_width together."
        )
    differs = {
        Changed.POSE: ask.place not in (None, (known.x, known.y, known.theta)),
        Changed.WIDTH: ask.width not in (None, known.width),
        Changed.STATE: ask.state not in (None, known.state),
        Changed.PROB_OPEN: ask.prob_open not in (None, known.prob_open),
        Changed.PROB_CLOSED: ask.prob_closed not in (None, known.prob_closed),
    }
    changed = Changed(sum(bit for bit, does in differs.items() if does))
    if not changed:
        return []
    x, y, theta = ask.place if changed & Changed.POSE and ask.place else (math.nan,) * 3
    return [
        ev.DoorUpdated(
            door_id=known.door_id,
            changed=changed,
            level=known.level,
            x=x,
            y=y,
            theta=theta,
            width=_or_nan(ask.width),
            state=known.state if ask.state is None else ask.state,
            prob_open=_or_nan(ask.prob_open),
            prob_closed=_or_nan(ask.prob_closed),
            happened_ns=happened_ns,
        )
    ]


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _why(error: errors.LogPoisonedError) -> str:
    return str(error).rstrip(".")
