"""Heads of messages: read at once, with the door that an event is about."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.core.messages import OBJECT_KINDS, fixed_layout
from semmap_log.core.model.events import KINDS, DoorEvent, Event
from semmap_log.store import records as mcap
from semmap_log.store.record_scan import HEAD_DTYPE, heads_of, walk


@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0\7\0"])
def test_a_last_message_may_carry_less_than_a_door(payload: bytes) -> None:
    """Messages of no kind of ours may be empty; their heads are read all the same."""
    records = mcap.message(1, 5, 10, 9, bytes(40)) + mcap.message(999, 6, 11, 8, payload)

    heads = heads_of(records, walk(records))

    assert [1, 999] == heads["channel_id"].tolist()
    assert [9, 8] == heads["publish_time"].tolist()
    assert [0, payload[4] if payload else 0] == heads["door_id"].tolist()


def test_no_messages_have_no_heads() -> None:
    """A chunk's records may be none; whoever asks for it finds out later."""
    assert 0 == len(heads_of(b"", np.empty(0, np.int64)))


@pytest.mark.parametrize(
    "kind",
    [kind for kind in KINDS if issubclass(kind, DoorEvent) and kind.kind not in OBJECT_KINDS],
)
def test_events_about_doors_begin_with_the_door(kind: type[Event]) -> None:
    """In every event of fixed size about a door its id lies where a head has it."""
    behind = fixed_layout(kind.kind).behind(mcap.MESSAGE_DTYPE)

    assert behind.fields is not None
    assert HEAD_DTYPE.fields is not None
    assert HEAD_DTYPE.fields["door_id"][:2] == behind.fields["door_id"][:2]
