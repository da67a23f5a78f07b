"""What is said of doors in words: for each door and key the text with the greatest stamp."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from semmap_log.domain.doors import DoorId
from semmap_log.errors import LogError

NAME = "name"
"""The key under which a door's name is said."""

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

    def get(self, door_id: int, key: str) -> tuple[Stamp, str] | None:
        """Return a text and its stamp; None: it was never written."""
        return self._unpacked().get(door_id, {}).get(key)

    def of(self, door_id: int, added: Stamp) -> Mapping[str, str]:
        """Return what is said of a door since it was added, keys ascending."""
        said = self._unpacked().get(door_id, {})
        return MappingProxyType(
            {key: value for key, (stamp, value) in sorted(said.items()) if value and stamp > added}
        )

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
