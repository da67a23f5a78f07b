"""What events do to doors, side by side as rows: the one form in which all follow doors over time.

Pure numpy. Who needs less than all of `CHANGE` asks for some of its columns: see `columns`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import SETTING_KINDS, Event
from semmap_log.core.model.meaning import ALL_CHANGED, FIELDS, Changed, Presence

Changes = NDArray[Any]
"""Rows of `CHANGE`, or of some of its columns."""

Stamp = tuple[int, int]
"""(folds_ns, number): the order in which events count."""

CHANGE = np.dtype([
    ("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"),
    ("kind", "u1"), ("sets", "u1"), ("door_id", "u4"), *FIELDS.items(),
])  # fmt: skip
"""An event about a door: its number, the time by which it is ordered, when it was recorded (both
nanoseconds since 1970, UTC), its kind, and the fields of the door after it. `sets` are the bits of
`Changed` and `THERE`; the fields outside them mean nothing."""

THERE = 128
"""In `sets`, beside the bits of `Changed`: it brings the door into the map, or takes it out."""
EVERYTHING = int(ALL_CHANGED) | THERE
STATE = int(Changed.STATE)


def columns(*names: str) -> np.dtype[Any]:
    """Return a type with these columns of `CHANGE`."""
    return np.dtype([(name, CHANGE[name]) for name in names])


STATE_CHANGE = columns("door_id", "folds_ns", "number", "kind", "state")
"""What an event says of a door's state: 22 bytes."""


def door_changes(batch: EventBatch) -> Changes:
    """Return the events of the batch that can change a door, in the order of their numbers."""
    changes = np.concatenate([np.empty(0, CHANGE), *parts_of(batch)])
    return changes[np.argsort(changes["number"], kind="stable")]


def parts_of(
    batch: EventBatch,
    dtype: np.dtype[Any] = CHANGE,
    *,
    setting: int | None = None,
    doors: NDArray[np.integer[Any]] | None = None,
) -> Iterator[Changes]:
    """Yield the events of a batch that can change a door, kind by kind.

    Args:
        batch: Any events.
        dtype: `CHANGE`, or some of its columns.
        setting: Only those that set one of these bits of `sets`; None: also those that set nothing,
            such as somebody who did not get through.
        doors: Only what is about these; None: all.
    """
    for kind in SETTING_KINDS:
        if kind in batch and (setting is None or _can_set(kind) & setting):
            places = chosen_of(batch, kind, setting=setting, doors=doors)
            yield rows_at(batch, kind, places, dtype)


def chosen_of(
    batch: EventBatch,
    kind: type[Event],
    *,
    setting: int | None = None,
    doors: NDArray[np.integer[Any]] | None = None,
) -> NDArray[np.intp]:
    """Return the places, among a kind's rows, of those that `parts_of` would yield."""
    rows = batch[kind]
    chosen = np.ones(len(rows), np.bool_)
    if setting is not None:
        chosen = (_bits_of(kind, rows) & setting) != 0
    if doors is not None:
        chosen &= np.isin(rows["door_id"], doors)
    return np.flatnonzero(chosen)


def rows_at(
    batch: EventBatch, kind: type[Event], places: NDArray[np.intp], dtype: np.dtype[Any]
) -> Changes:
    """Return a kind's rows at some places as rows of `CHANGE`, or of some of its columns."""
    changes = np.empty(len(places), dtype)
    fill(changes, batch, kind, places)
    return changes


def fill(changes: Changes, batch: EventBatch, kind: type[Event], places: NDArray[np.intp]) -> None:
    """Write a kind's rows at some places into as many rows; what they do not say becomes 0."""
    rows, where = batch[kind], batch.where(kind)[places]
    for name in changes.dtype.names or ():
        if name in _OF_EVENT:
            changes[name] = _OF_EVENT[name](batch)[where]
        elif name in kind.effect.values:
            changes[name] = kind.effect.values[name]
        elif name in (rows.dtype.names or ()):
            changes[name] = rows[name][places]
        else:
            changes[name] = _bits_of(kind, rows)[places] if name == "sets" else 0


_OF_EVENT: Mapping[str, Callable[[EventBatch], NDArray[Any]]] = {
    "number": lambda batch: batch.number,
    "folds_ns": lambda batch: batch.folds_ns,
    "recorded_ns": lambda batch: batch.recorded_ns,
    "kind": lambda batch: batch.kind,
}
"""Columns of every event, whatever it is about."""


def known_states(states: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return numbers of states; those that only a later version knows are UNKNOWN."""
    return np.where(states < len(DoorState), states, np.uint8(DoorState.UNKNOWN))


def of_presence(changes: Changes, presence: Presence) -> NDArray[np.bool_]:
    """Tell which rows bring a door into the map, take it out, or do neither."""
    found: NDArray[np.bool_] = _PRESENCE[changes["kind"]] == presence.value
    return found


def are_sightings(changes: Changes) -> NDArray[np.bool_]:
    """Tell which rows are sightings: see `Effect.is_sighting`."""
    found: NDArray[np.bool_] = _IS_SIGHTING[changes["kind"]]
    return found


def is_before(changes: Changes, stamp: Stamp) -> NDArray[np.bool_]:
    """Tell which rows come before a stamp: (folds_ns, number)."""
    folds_ns, number = stamp
    ties = (changes["folds_ns"] == folds_ns) & (changes["number"] < number)
    earlier: NDArray[np.bool_] = (changes["folds_ns"] < folds_ns) | ties
    return earlier


def _can_set(kind: type[Event]) -> int:
    effect = kind.effect
    return int(effect.can_set) | (0 if effect.presence is Presence.STAYS else THERE)


def _bits_of(kind: type[Event], rows: NDArray[np.void]) -> NDArray[np.uint8]:
    """Return the bits that each event sets."""
    effect = kind.effect
    if effect.says_what:
        bits: NDArray[np.uint8] = rows["changed"]
        return bits
    bits = np.full(len(rows), _can_set(kind), np.uint8)
    return np.where(rows[effect.only_if], bits, np.uint8(0)) if effect.only_if else bits


_PRESENCE = np.full(256, Presence.STAYS.value, np.uint8)
_IS_SIGHTING = np.zeros(256, np.bool_)
for _kind in SETTING_KINDS:
    _PRESENCE[_kind.kind] = _kind.effect.presence.value
    _IS_SIGHTING[_kind.kind] = _kind.effect.is_sighting
