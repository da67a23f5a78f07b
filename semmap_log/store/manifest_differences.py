"""In what a segment differs from what a manifest tells of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from semmap_log.store.manifest import ShippedSegment

_WORDS = {
    "size": "bytes",
    "sha256": "the SHA-256",
    "head_end": "the end of the head",
    "next_event": "the next event",
    "head": "the hash of the last commit",
    "counts": "the messages on each channel",
    "recorded": "the recorded times",
    "happened": "the times at which it happened",
    "number": "the number",
    "last_number": "the last number",
    "first_event": "the first event",
    "hash_so_far": "the hash of the commit before",
    "minor": "the minor version",
    "others": "other entries of the head",
    "info": "the log",
}
"""What fields of an entry, and of its header, are called in messages."""


def differences(told: ShippedSegment, found: ShippedSegment) -> Iterator[str]:
    """Yield in what a manifest's entry differs from a segment's own, in words."""
    yield from _differences(told.header, found.header)
    yield from _differences(told, found)


def _differences(told: Any, found: Any) -> Iterator[str]:
    for each in fields(found):
        if each.name not in _WORDS:
            continue
        said, is_so = getattr(told, each.name), getattr(found, each.name)
        if said != is_so:
            yield f"it tells of {_shown(said)} as {_WORDS[each.name]}; there is {_shown(is_so)}"


def _shown(value: object) -> object:
    return value.hex() if isinstance(value, bytes) else value
