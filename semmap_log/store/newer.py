"""What a later minor version has put at the head of a segment: kinds of events unknown here.

They are kept as bytes, so that whoever rewrites the segment keeps them. What such a version may
add, and what it guarantees, is stated in `byte_layout`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from mcap.opcode import Opcode

from semmap_log.core.model.events import KINDS
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import CHANGES_KEY, LAST_EVENT_CHANNEL, NOTHING

MOST_NAME_CHARACTERS = 100
"""Of a kind: a stranger's log must not fill the screen."""


@dataclass(frozen=True)
class Newer:
    """Schemas and Channels of later kinds: number -> record, frame included; ids ascending."""

    schemas: tuple[tuple[int, bytes], ...] = ()
    channels: tuple[tuple[int, bytes], ...] = ()

    @classmethod
    def of(cls, records: Iterable[tuple[int, bytes]]) -> Newer:
        """Return what is unknown among the Schemas and Channels of a head.

        Args:
            records: Opcode and bytes of each, frame included.
        """
        found: dict[int, dict[int, bytes]] = {Opcode.SCHEMA: {}, Opcode.CHANNEL: {}}
        for opcode, record in records:
            number = number_of(record)
            if is_later_kind(number):
                found[opcode][number] = record
        return cls(*(tuple(sorted(found[kind].items())) for kind in found))

    @classmethod
    def all_of(cls, heads: Iterable[Newer]) -> Newer:
        """Return what is unknown in any of some heads of one log."""
        schemas, channels = dict[int, bytes](), dict[int, bytes]()
        for head in heads:
            schemas.update(head.schemas)
            channels.update(head.channels)
        return cls(tuple(sorted(schemas.items())), tuple(sorted(channels.items())))

    def __bool__(self) -> bool:
        return bool(self.schemas or self.channels)

    @cached_property
    def names(self) -> dict[int, str]:
        """What the kinds are called, such as `DoorLocked`: the last part of the schema's name."""
        from mcap.records import Schema

        told = {number: str(_read(Schema, record, "name")) for number, record in self.schemas}
        names = {number: name.rpartition("/")[2] for number, name in told.items()}
        return {n: name for n, name in names.items() if _is_name(name)}

    @cached_property
    def topics(self) -> dict[int, tuple[str, str, str, str]]:
        """Topic, type, offered QoS and hash of the type of each channel; one line each."""
        from mcap.records import Channel, Schema

        types = {number: _read(Schema, record, "name") for number, record in self.schemas}
        told: dict[int, tuple[str, str, str, str]] = {}
        for number, record in self.channels:
            said = dict(_read(Channel, record, "metadata") or {})
            texts = (
                str(_read(Channel, record, "topic")),
                str(types.get(number, "")),
                str(said.get("offered_qos_profiles", "")),
                str(said.get("topic_type_hash", "")),
            )
            if all(text and text.isprintable() for text in texts):
                told[number] = texts
        return told

    @cached_property
    def harmless(self) -> frozenset[int]:
        """The kinds that change no answer about other events."""
        from mcap.records import Channel

        return frozenset(
            number
            for number, record in self.channels
            if dict(_read(Channel, record, "metadata") or {}).get(CHANGES_KEY) == NOTHING
        )


NOTHING_NEWER = Newer()


def is_later_kind(number: int) -> bool:
    """Return whether that is the number of a kind, channel or schema that is unknown here."""
    return len(KINDS) < number <= LAST_EVENT_CHANNEL


def number_of(record: bytes | memoryview) -> int:
    """Return the id of a Schema or a Channel."""
    at = mcap.FRAME.size
    return int.from_bytes(record[at : at + 2], "little")


def _is_name(text: str) -> bool:
    return text.isascii() and text.isidentifier() and len(text) <= MOST_NAME_CHARACTERS


def name_of(number: int, names: Mapping[int, str]) -> str:
    """Return what an unknown kind is called; without a name of its own after its number."""
    return names.get(number) or f"Kind{number}"


def _read(kind: type, record: bytes, name: str) -> Any:
    """Return a field of a record; an empty one where it cannot be read: a head has no CRC."""
    try:
        return getattr(mcap.read_record(kind, record[mcap.FRAME.size :]), name)
    except ValueError:
        return ""
