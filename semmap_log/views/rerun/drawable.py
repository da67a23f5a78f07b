"""Text that the rerun viewer can draw, names that can be part of an entity path, and event lines.

The viewer has one font (Inter) and no other to fall back on: a character outside it is drawn as a
box on the screen, and ends a headless viewer with a panic. The font has Latin, Greek and Cyrillic
letters; no Chinese, Japanese or Korean ones, no Arabic, Hebrew, Thai or Indian ones, and few
emoji. So a name with such a letter gives way to a number, and in other text such letters become
boxes.

An event is a line of text: when, which door, what, who and why. A recording without doors shows a
hint on what to do instead.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import Changes, Stamp
from semmap_log.core.model.doors import DOOR, DoorState
from semmap_log.core.model.events import DoorEvent, Event, Retracted, RobotPose
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.meaning import NO_EFFECT, PLACING, Presence
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.views import event_words, zone_times
from semmap_log.views.event_words import reported_state, words_of
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.scene import RepeatFinder, RowWriter, Scene, SceneDoor, is_long

if TYPE_CHECKING:
    from semmap_log.core.model.commits import Commit


INFO, WARN, DEBUG = "INFO", "WARN", "DEBUG"
"""INFO: the map changed; WARN: look here; DEBUG: it did not change."""

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
    """Describes events in words; remembers each door's state, to separate changes from repeats."""

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
        """Return the time on the building's clocks: `2026-03-01T14:02:00`."""
        seconds = times_ns // SECOND_NS
        wall = (seconds + self._clock.offset_s(seconds)).astype("M8[s]")
        shown: list[str] = np.datetime_as_string(wall, unit="s").tolist()
        return shown

    def _offsets(self, times_ns: NDArray[np.int64]) -> list[str]:
        """Return the offset of those clocks from UTC then: ` UTC+2`."""
        return [
            f" {zone_times.from_utc(s)}"
            for s in self._clock.offset_s(times_ns // SECOND_NS).tolist()
        ]

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
            return INFO, said, reported_state(event)
        goes = event.effect.presence is Presence.GOES
        if not (goes or door.life.added <= stamp < door.life.removed):
            return DEBUG, f"{said} (not in the map then)", None
        state = reported_state(event)
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
        """Store the door's state; return whether it changed."""
        if state is None:
            return False
        latest_ns, known = self._states.get(event.door_id, (-1, None))
        if stamp[0] < latest_ns:
            return event.effect.presence is Presence.COMES  # a late event: the map has moved on
        self._states[event.door_id] = stamp[0], state
        return state != known


def offsets_in(scene: Scene, tz: str) -> list[str]:
    """Return how far a zone's clocks are ahead of UTC within what a scene shows: `UTC+1`."""
    span = zone_times.Span(
        scene.begin.folds_ns // zone_times.MS_NS, scene.end.folds_ns // zone_times.MS_NS
    )
    return list(
        dict.fromkeys(
            zone_times.from_utc(offset_s) for _, offset_s in zone_times.zone_offsets(span, tz)
        )
    )


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


NOTHING = "nothing"


def write_nothing(writer: RowWriter, excerpt: Excerpt, scene: Scene) -> None:
    """Write a hint if there are no doors."""
    if scene.doors:
        return
    said = zone_times.how_to_begin(excerpt.log) or zone_times.NOT_IN_THIS_PART
    lines = [drawable(line) for line in said.splitlines()]
    writer.static((NOTHING,), rr.TextDocument("\n".join(lines), media_type="text/plain"))


BOX = "□"
"""Stands for a character that the viewer cannot draw."""

LONGEST_PART = 40

_FONT = """
20-7e a0-ac ae-148 14a-1c3 1c5-31e 321-377 37a-37f 384-38a 38c 38e-3a1 3a3-3e1 3f0-49d 4a0-4ff 52f
e3f 1d43 1d47-1d49 1d4d 1d4f-1d50 1d52 1d56-1d58 1d5b 1d62-1d65 1d9c 1da0 1dbb 1dbf-1df5 1dfc-1f15
1f18-1f1d 1f20-1f45 1f48-1f4d 1f50-1f57 1f59 1f5b 1f5d 1f5f-1f7d 1f80-1fb4 1fb6-1fc4 1fc6-1fd3
1fd6-1fdb 1fdd-1fef 1ff2-1ff4 1ff6-1ffe 2000-200a 2010-2027 202f-205f 2070-2071 2074-208e 2090-209c
20a0-20bf 20db-20de 20e8 20f0 2100-2101 2103 2105-2106 2109 2113 2116-2117 211e-2123 2126 212a-212b
212e 2132 213b 214d 214f 2153 215a-2188 2190-2199 21a9-21aa 21b0-21b1 21b3-21b5 21ba-21bb 21d0 21d2
21d4 21de-21df 21e4-21e5 21e7 21ea 2202 2205-2206 220f 2211-2212 221a 221e 222b 2248 2260 2264-2265
2303 2305 2318 2325-2327 232b 2380 2387 238b 23ce-23cf 2423 2460-2468 24b6-24cf 24ea 25a0-25a2 25aa
25b2-25b3 25b6-25b7 25ba-25bd 25c0-25c1 25c4-25c7 25ca-25cb 25cf 25e6 25ef 2600 2605-2606 263c 2661
2665 26a0 2713 2717 2756 2764 2780-2788 27ef 27f5-27fa 2b06 2b12-2b13 2b1c 2c7c 2c7f 2dff 2e18 a69f
a7ff a92e fe20-fe2d 1f12f-1f149 1f16a-1f16b 1f850 1f852
"""
"""What Inter holds in rerun 0.41, hexadecimal, without controls and characters for private use."""


def _ranges() -> list[tuple[int, int]]:
    ends = [part.split("-") for part in _FONT.split()]
    return [(int(pair[0], 16), int(pair[-1], 16)) for pair in ends]


_DRAWN = _ranges()


def drawable(text: str) -> str:
    """Return the text with a box for each character that the viewer's font does not have."""
    if text.isascii() and text.isprintable():
        return text
    composed = unicodedata.normalize("NFC", text)
    return "".join(character if _is_drawn(character) else _stand_in(character)
                   for character in composed)  # fmt: skip


def drawable_name(name: str, stand_in: str) -> str:
    """Return a name as the viewer can draw it, or its substitute if a letter is missing."""
    return event_words.drawable_name(name, stand_in, _is_drawn)


def is_drawable_name(name: str) -> bool:
    """Return whether a name can be drawn without a substitute."""
    return drawable_name(name, "") != ""


def path_part(text: str) -> str:
    """Return the text as part of an entity path that the viewer shows without escapes.

    Letters, digits, `.`, `-` and `_` stay, as many as fit into a lane's head; anything between them
    becomes one `_`. A name that the viewer cannot draw becomes empty.
    """
    kept = [character if character.isalnum() or character in ".-_" else " "
            for character in drawable_name(text, "")]  # fmt: skip
    return "_".join("".join(kept).split())[:LONGEST_PART].strip(".-_")


def unique_parts(names: Iterable[tuple[int, str]], what: str = "door") -> dict[int, str]:
    """Return a path part for each (number, name): readable, and each a different one.

    A name without any usable character becomes `<what>_<number>`. Where two would be equal,
    ignoring case, all but the first get their number appended.
    """
    parts: dict[int, str] = {}
    taken: set[str] = set()
    for number, name in sorted(names):
        parts[number] = free_part(number, name, taken, what)
        taken.add(parts[number].casefold())
    return parts


def free_part(number: int, name: str, taken: Collection[str], what: str = "door") -> str:
    """Return the path part for a name, with the number appended if it is taken (case folded)."""
    part = path_part(name) or f"{what}_{number}"
    while part.casefold() in taken:
        part = f"{part}_{number}"
    return part


def _is_drawn(character: str) -> bool:
    code = ord(character)
    return any(first <= code <= last for first, last in _DRAWN)


def _stand_in(character: str) -> str:
    return " " if character.isspace() or unicodedata.category(character) == "Cc" else BOX
