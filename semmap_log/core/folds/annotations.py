"""What is said of doors in words: for each door and key the text with the greatest stamp."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import ClassDefined
from semmap_log.core.model.object_classes import ObjectClass
from semmap_log.errors import LogError

NAME = "name"
"""The key under which a door's name is said."""

_NO_DOOR = 0
_DEFINES = "\x01class:"
"""What is said of a class stands beside what is said of door 0, under keys that begin so, as nobody
types them: in keyframes, too, which have no other place for it."""

Stamp = tuple[int, int]
"""(happened time, event number)."""

_Said = dict[int, dict[str, tuple[Stamp, str]]]

_COLUMNS = ("door_id", "key", "value", "happened_ns", "event")


class Annotations:
    """Registers of texts; what was stored is unpacked when somebody asks."""

    def __init__(self) -> None:
        self._said: _Said = {}
        self._stored: Mapping[str, Any] | None = None
        self._is_shared = False
        """Whether a snapshot holds the same dictionaries: they must not change any more."""

    def write(self, door_id: int, key: str, value: str, stamp: Stamp) -> None:
        """Note what was said at a stamp, unless something later is known."""
        if self._is_shared:
            self._said = {door: dict(texts) for door, texts in self._unpacked().items()}
            self._is_shared = False
        said = self._unpacked().setdefault(door_id, {})
        if key not in said or stamp > said[key][0]:
            said[key] = (stamp, value)

    def define(self, event: ClassDefined, stamp: Stamp) -> None:
        """Note what objects of a class are like."""
        texts = (event.geometry, event.states, event.blocks)
        told = "\n".join(text.replace("\n", " ") for text in texts)
        self.write(_NO_DOOR, _DEFINES + event.class_name, told, stamp)

    def classes(self) -> dict[str, ObjectClass]:
        """Return the classes that were defined, names ascending."""
        if self._stored is not None and _NO_DOOR not in np.asarray(self._stored["door_id"]):
            return {}  # nothing is unpacked for it
        said = self._unpacked().get(_NO_DOOR, {})
        defined = {
            key.removeprefix(_DEFINES): text.split("\n", 2)
            for key, (_, text) in sorted(said.items())
            if key.startswith(_DEFINES)
        }
        return {name: ObjectClass.told(name, *told) for name, told in defined.items()}

    def defined(self, name: str) -> Stamp | None:
        """Return when a class was defined last; None: never."""
        told = self.get(_NO_DOOR, _DEFINES + name)
        return None if told is None else told[0]

    def said_under(self, key: str) -> dict[DoorId, tuple[Stamp, str]]:
        """Return what is said of each door under a key, and its stamp; ids ascending."""
        said = sorted(self._unpacked().items())
        return {DoorId(door_id): texts[key] for door_id, texts in said if key in texts}

    def forget(self, door_id: int, key: str, before: int) -> None:
        """Leave out what events below a number said of a door under a key."""
        said = self._unpacked().get(door_id, {})
        if key in said and said[key][0][1] < before:
            del said[key]

    def get(self, door_id: int, key: str) -> tuple[Stamp, str] | None:
        """Return a text and its stamp; None: it was never written."""
        return self._unpacked().get(door_id, {}).get(key)

    def of(self, door_id: int, added: Stamp) -> Mapping[str, str]:
        """Return what is said of a door since it was added, keys ascending."""
        said = self._unpacked().get(door_id, {})
        since = {key: value for key, (stamp, value) in sorted(said.items()) if stamp > added}
        if door_id == _NO_DOOR:
            since = {key: value for key, value in since.items() if not key.startswith(_DEFINES)}
        return MappingProxyType({key: value for key, value in since.items() if value})

    def names(self) -> dict[DoorId, str]:
        """Return the latest name of every door that has one, ids ascending."""
        said = {DoorId(door_id): texts.get(NAME) for door_id, texts in self._unpacked().items()}
        return {door_id: name[1] for door_id, name in sorted(said.items()) if name and name[1]}

    def events(self) -> list[int]:
        """Return the number of the event of each text."""
        return [stamp[1] for said in self._unpacked().values() for stamp, _ in said.values()]

    def snapshot(self) -> Annotations:
        """Return them as they are now, whatever is written later."""
        copy = Annotations()
        copy._said, copy._stored = self._said, self._stored
        self._is_shared = copy._is_shared = True
        return copy

    def to_arrays(self) -> dict[str, list[Any]]:
        """Return them as parallel lists, by door and key."""
        texts = [
            (door_id, key, value, *stamp)
            for door_id, said in sorted(self._unpacked().items())
            for key, (stamp, value) in sorted(said.items())
        ]
        return {f"annotation_{name}": [t[i] for t in texts] for i, name in enumerate(_COLUMNS)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Annotations:
        """Return those that `to_arrays` gave; not unpacked before they are needed."""
        annotations = cls()
        annotations._stored = {name: arrays[f"annotation_{name}"] for name in _COLUMNS}
        return annotations

    def _unpacked(self) -> _Said:
        if self._stored is not None:
            try:
                self._said, self._stored = _unpack(self._stored), None
            except ValueError as error:
                raise LogError(f"A keyframe's texts are none: {error}; verify the log.") from None
        return self._said


def _unpack(stored: Mapping[str, Any]) -> _Said:
    columns = [list(stored["key"]), list(stored["value"])]
    columns += [np.asarray(stored[name]).tolist() for name in ("door_id", "happened_ns", "event")]
    said: _Said = {}
    for key, value, door_id, happened, event in zip(*columns, strict=True):
        said.setdefault(door_id, {})[key] = ((happened, event), value)
    return said
