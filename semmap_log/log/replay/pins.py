"""Pinned moments: their state is kept when what was before the horizon is not.

While the log holds all that the answer needs, a pin is a name for a moment. Before its events go,
retention writes the state of that moment into the log; what is told of it later is folded onto it.
"""

from __future__ import annotations

import base64
import zlib

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.io.inflating import inflated
from semmap_log.core.model.events import MomentPinned
from semmap_log.log.replay import keyframes
from semmap_log.store.chunk_unpacking import most_unpacked
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window


def pins(reader: LogReader) -> dict[str, MomentPinned]:
    """Return the pins of a log by their names, as they were made, or got a state, last."""
    hidden = reader.retractions()
    found: dict[str, MomentPinned] = {}
    for batch in reader.batches(Window(kinds=bits_of_kinds([MomentPinned]))):
        for recorded in hidden.visible(batch):
            assert isinstance(recorded.event, MomentPinned), "no other kind was asked for"
            found[recorded.event.name] = recorded.event
    return found


def pinned_state(
    reader: LogReader, at_ns: int, *, before_event: int | None = None
) -> DoorMapState | None:
    """Return the state of a moment before the horizon, with all that is known today.

    None: it was not pinned, or its state cannot be used.

    Args:
        reader: Of the log.
        at_ns: The moment.
        before_event: Only events below that number; None: all.
    """
    pin = next((p for p in pins(reader).values() if p.at_ns == at_ns and p.keyframe), None)
    state = None if pin is None else unpacked(pin.keyframe)
    if pin is None or state is None:
        return None
    window = Window(
        first_event=pin.next_event, before_event=before_event, happened_before_ns=at_ns + 1
    )
    retractions = reader.retractions()
    for batch in reader.batches(window):
        state.note_used_ids(batch)
        state.apply(retractions.visible(batch))
    return state


def with_state(pin: MomentPinned, state: DoorMapState, next_event: int) -> MomentPinned:
    """Return a pin with the state of its moment.

    Args:
        pin: The pin.
        state: With the events below `next_event`.
        next_event: What comes from there on is not in it.
    """
    data = base64.b64encode(zlib.compress(keyframes.encode(state))).decode()
    return MomentPinned(at_ns=pin.at_ns, next_event=next_event, name=pin.name, keyframe=data)


def unpacked(text: str) -> DoorMapState | None:
    """Return the state in a pin; None: it is of another version, damaged, or larger than any."""
    try:
        packed = base64.b64decode(text, validate=True)
        return keyframes.decode(inflated(packed, most_unpacked(len(packed))))
    except ValueError:
        return None
