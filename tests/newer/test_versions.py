"""Who adds a kind, or changes one, must add a version: older programs are told by it."""

from __future__ import annotations

import hashlib

import pytest

from semmap_log.core.messages import schema_text
from semmap_log.core.model.events import KINDS
from semmap_log.store.byte_layout import (
    COMMIT_CHANNEL,
    FORMAT_MINOR,
    FORMAT_VERSION,
    KINDS_OF_MINOR,
    LAST_EVENT_CHANNEL,
    topics,
)
from semmap_log.store.pages import UNKNOWN_BIT

KINDS_OF = {
    "3.0": {
        "DoorAdded": "4a35add95614fd04",
        "DoorUpdated": "a7dd867f30eca0f6",
        "DoorRemoved": "9a7c183807dc7ac1",
        "DoorObserved": "773d9a0d8b511c62",
        "DoorRequested": "0c4ecbd448285ba9",
        "DoorPassed": "c64231b0209b9218",
        "PatrolStarted": "9a7280ed763265ec",
        "PatrolFinished": "f9171c55224b651c",
        "RobotPose": "a422541588c90ab3",
        "Retracted": "6737e09d50991d70",
        "DoorAnnotated": "2b7abe6abc075679",
        "LevelAdded": "41fdfa2037ad1f46",
        "FloorMap": "749a8672d761b00e",
        "LogExported": "7d2d7b8b75b91b89",
    },
    "3.1": {
        "HistoryTrimmed": "df140af9667fb26b",
        "MomentPinned": "3285bdc4bb3caca6",
        "SightingsThinned": "6cd00af43bd704a8",
        "ClassDefined": "3cfad559eb02ce32",
    },
}
"""Version -> the kinds that it added, in their order, with a digest of what their Schema says.

A line here is what a program of that version has on its robot: lines are added, none is changed."""


def _digest(ros_type: str) -> str:
    return hashlib.sha256(schema_text(ros_type).encode()).hexdigest()[:16]


def test_every_kind_is_as_its_version_has_it() -> None:
    """To add a kind: a line here under a new version, and its count in `KINDS_OF_MINOR`."""
    types = {topic.schema_id: topic.ros_type for topic in topics()}
    now = {kind.__name__: _digest(types[kind.kind]) for kind in KINDS}

    assert {name: digest for added in KINDS_OF.values() for name, digest in added.items()} == now
    assert list(now) == [name for added in KINDS_OF.values() for name in added]


def test_each_version_has_the_kinds_that_it_says() -> None:
    """The number that is written into each segment is that of the last line of the table."""
    counts, total = [], 0
    for added in KINDS_OF.values():
        total += len(added)
        counts.append(total)

    assert tuple(counts) == KINDS_OF_MINOR
    assert list(KINDS_OF) == [f"{FORMAT_VERSION}.{minor}" for minor in range(len(counts))]
    assert f"{FORMAT_VERSION}.{FORMAT_MINOR}" == list(KINDS_OF)[-1]


def test_there_is_room_for_later_kinds() -> None:
    """Each kind has a channel below the log's own, and a bit below that of the unknown ones."""
    assert len(KINDS) < LAST_EVENT_CHANNEL < COMMIT_CHANNEL
    assert 1 << len(KINDS) < UNKNOWN_BIT


@pytest.mark.parametrize("topic", topics(), ids=lambda topic: topic.topic)
def test_what_the_first_version_has_is_not_marked(topic: object) -> None:
    """Every program knows it: a mark would change the bytes of heads that are written for ever."""
    assert not (topic.since_minor == 0 and topic.changes_nothing)  # type: ignore[attr-defined]
