"""Pseudonyms in place of names: they show that two events have one actor, but not who it is.

Actors, sources, correlations, rooms, lifts and classes are numbered as they come; doors and levels
are called by their numbers; reasons and all other free text are removed. Times, places of doors
and states stay: who knows when somebody went through a door may still find out who it was (hence
pseudonymous, not anonymous: GDPR, article 4 (5)).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import fields, replace

from semmap_log.analysis.rooms.room_graph import LIFT, ROOMS
from semmap_log.core.model import events
from semmap_log.core.model.commits import NO_CONTENT, Commit, Note
from semmap_log.core.model.doors import CLASS, OUTLINE, WORDED, parse_outline

LEFT_OUT = (events.HistoryTrimmed, events.LogExported, events.MomentPinned, events.UnknownEvent)
"""Kinds that say in words what nobody else needs, or what is not known here."""


class Pseudonyms:
    """Who is called how, and what was left out so far."""

    def __init__(self, *, with_tracks: bool = False) -> None:
        """Begin without any.

        Args:
            with_tracks: Include where the robot was.
        """
        self._with_tracks = with_tracks
        self._names: dict[str, dict[str, int]] = {}
        """What is called -> its name -> its number."""
        self._commits: dict[int, int] = {}
        self.left_out: Counter[str] = Counter()
        """What was left out, by kind of event; annotations by `DoorAnnotated`."""

    def event(self, event: events.Event) -> events.Event | None:
        """Return an event without names; None: it is left out."""
        told = self._told(event)
        if told is None:
            self.left_out[type(event).__name__] += 1
        return told

    def commit(self, commit: Commit) -> Commit:
        """Return a commit whose note names nobody, and whose id is its place in the log."""
        place = self._commits.setdefault(commit.first_event, len(self._commits))
        return replace(
            commit,
            note=self.note(commit.note),
            command_id=place.to_bytes(len(commit.command_id), "big"),
            content=NO_CONTENT,
        )

    def note(self, note: Note) -> Note:
        """Return a note of the same people, under other names, without its reason."""
        return Note(
            actor=self._called("actor", note.actor),
            source=self._called("source", note.source),
            correlation=self._called("correlation", note.correlation),
        )

    def _told(self, event: events.Event) -> events.Event | None:
        if isinstance(event, LEFT_OUT):
            return None
        if isinstance(event, events.RobotPose):
            return event if self._with_tracks else None
        if isinstance(event, events.LevelAdded):
            return replace(event, name=f"level-{event.level}")
        if isinstance(event, events.DoorAnnotated):
            return self._annotation(event)
        if isinstance(event, events.ClassDefined):
            return self._class(event)
        texts = [f.name for f in fields(event) if isinstance(getattr(event, f.name), str)]
        assert not texts, f"{type(event).__name__} has texts: {texts}"
        return event

    def _class(self, event: events.ClassDefined) -> events.ClassDefined:
        """Return a class that is called by its number, and its states as a door's."""
        one = event.object_class
        return replace(
            event,
            class_name=self._called(CLASS, event.class_name),
            states=",".join(state.name for state in WORDED[: len(one.words)]),
            blocks=",".join(state.name for state in sorted(one.blocks)),
        )

    def _annotation(self, event: events.DoorAnnotated) -> events.DoorAnnotated | None:
        if event.key == "name":
            return replace(event, value=event.value and f"door-{event.door_id}")
        if event.key == CLASS:  # whether a class is called so, now or later
            return replace(event, value=self._called(CLASS, event.value))
        if event.key == OUTLINE:
            return event if _is_outline(event.value) else replace(event, value="")
        if event.key == LIFT:
            return replace(event, value=self._called("lift", event.value))
        if event.key == ROOMS:
            names = (name.strip() for name in event.value.split(","))
            return replace(event, value=",".join(self._called("room", name) for name in names))
        return None

    def _called(self, what: str, name: str) -> str:
        if not name:
            return ""
        known = self._names.setdefault(what, {})
        return f"{what}-{known.setdefault(name, len(known) + 1)}"


def _is_outline(text: str) -> bool:
    try:
        parse_outline(text)
    except ValueError:
        return not text
    return True
