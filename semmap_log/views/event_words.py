"""Describe an event in a few words, without its time and the door's name.

Also names in a picture whose fonts lack some of their letters: the whole name, or a substitute.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Callable
from typing import NoReturn, cast

from semmap_log.core.model import events
from semmap_log.core.model.doors import DOOR, DoorState, ObjectClass
from semmap_log.core.model.meaning import PARTS, Changed
from semmap_log.core.model.moments import format_utc
from semmap_log.core.texts import counted, percent


def words_of(event: events.Event, of: ObjectClass = DOOR, *, in_full: bool = False) -> str:
    """Return what happened, such as `seen OPEN (90 %)`.

    Args:
        event: The event.
        of: The class of the event's object, which names the states.
        in_full: As part of a sentence: `seen OPEN (accuracy 90 %)`.
    """
    known = cast("events.AnyEvent", event)
    match known:
        case events.DoorAdded():
            place = "" if not math.isnan(known.x) else " without a place"
            return f"added{place}, {of.word(known.state)}{_probabilities(known)}"
        case events.DoorUpdated():
            return _update(known, of)
        case events.DoorRemoved():
            return "removed from the map"
        case events.DoorObserved():
            seen = f"seen {of.word(known.state)}"
            return f"{seen}{_accuracy(known, in_full=in_full)}{_opening(known)}"
        case events.DoorRequested():
            return f"asked to be {of.word(known.state)}"
        case events.DoorPassed():
            unit = "seconds of waiting" if in_full else "s"
            waited = "" if math.isnan(known.waited_s) else f" after {known.waited_s:.0f} {unit}"
            return f"passed{waited}" if known.passed else f"given up{waited}"
        case events.PatrolStarted():
            return f"patrol {known.patrol} started"
        case events.PatrolFinished():
            return f"patrol {known.patrol} finished"
        case events.RobotPose():
            return f"robot at {known.x:.2f}, {known.y:.2f}"
        case events.Retracted():
            if known.first_event == known.last_event:
                return f"event {known.first_event} retracted"
            return f"events {known.first_event}..{known.last_event} retracted"
        case events.DoorAnnotated():
            return f"{known.key} = {known.value}"
        case events.LevelAdded():
            return f"level {known.level} is called {known.name}"
        case events.FloorMap():
            rows, columns = known.cells.shape
            return f"floor plan of level {known.level}: {columns} x {rows} cells"
        case events.LogExported():
            return f"exported as {known.format}: {known.file_name}"
        case events.HistoryTrimmed():
            return f"history trimmed ({known.reasons}): {known.rule}"
        case events.MomentPinned():
            return f"moment pinned: {known.name}, {format_utc(known.at_ns)}"
        case events.SightingsThinned():
            return f"seen {of.word(known.state)} {counted(known.count, 'time')} more; thinned"
        case events.ClassDefined():
            blocks = f"; {known.blocks} blocks" if known.blocks else "; blocks nothing"
            return f"class {known.class_name}: a {known.geometry}, {known.states}{blocks}"
        case events.UnknownEvent():
            return f"{type(known).__name__}: unknown here, of a newer version"
        case _:
            impossible: NoReturn = known
            raise AssertionError(impossible)


def printable(text: str) -> str:
    """Return a text from outside with terminal control characters escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def reported_state(event: events.Event) -> DoorState | None:
    """Return the state that an event gives to its door; None: it leaves the state alone."""
    return event.values_set().get("state")


def _update(event: events.DoorUpdated, of: ObjectClass) -> str:
    said = []
    if event.changed & Changed.STATE:
        said.append(f"set to {of.word(event.state)}")
    if event.changed & Changed.POSE:
        said.append(f"moved to {event.x:.2f}, {event.y:.2f}")
    if event.changed & Changed.WIDTH:
        said.append(f"width {event.width:.2f} m")
    if event.changed & Changed.PROB_OPEN:
        said.append(f"P(open) {event.prob_open:.2f}")
    if event.changed & Changed.PROB_CLOSED:
        said.append(f"P(closed) {event.prob_closed:.2f}")
    others = (part for part in PARTS if part & event.changed & ~_WORDED)
    said += [f"{name} {getattr(event, name)}" for part in others for name in PARTS[part]]
    return ", ".join(said)


_WORDED = Changed.POSE | Changed.WIDTH | Changed.STATE | Changed.PROB_OPEN | Changed.PROB_CLOSED


def _probabilities(event: events.DoorAdded) -> str:
    said = "" if math.isnan(event.prob_open) else f", P(open) {event.prob_open:.2f}"
    return said + ("" if math.isnan(event.prob_closed) else f", P(closed) {event.prob_closed:.2f}")


def _accuracy(event: events.DoorObserved, *, in_full: bool) -> str:
    """Return how often the sensor reads such a state correctly, if it has errors."""
    match event.state:
        case DoorState.OPEN:
            right = event.accuracy_open
        case DoorState.CLOSED:
            right = event.accuracy_closed
        case _:
            return ""
    if right == 1:
        return ""
    return f" ({'accuracy ' if in_full else ''}{percent(right)})"


def _opening(event: events.DoorObserved) -> str:
    return "" if math.isnan(event.opening) else f", {event.opening:.0%} open"


HasShape = Callable[[str], bool]
"""Returns whether the fonts of a picture have a shape for a character."""


MOST_DRAWN = 200
"""Letters of a name that a picture shows: one from a stranger's log may have thousands."""


def drawable_name(name: str, stand_in: str, has_shape: HasShape) -> str:
    """Return a name as it can be drawn, or its substitute if a letter is missing.

    A name drawn in part would not identify a door: two rooms may differ in just the
    letters that are missing. Other signs, such as emoji, are left out.
    """
    cut = name if len(name) <= MOST_DRAWN else f"{name[:MOST_DRAWN]}..."
    composed = unicodedata.normalize("NFC", cut)
    if any(unicodedata.category(c)[0] in "LMN" and not has_shape(c) for c in composed):
        return stand_in
    kept = " ".join("".join(c if has_shape(c) else " " for c in composed).split())
    return kept if any(map(str.isalnum, kept)) else stand_in
