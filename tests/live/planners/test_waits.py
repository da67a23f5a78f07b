"""Questions that wait: each is answered once, whoever has the answer first."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorState
from semmap_log.live.planners.door_view import DoorView
from semmap_log.live.planners.oracle import Wait, Waits
from semmap_log.live.planners.question_lines import Answer


@pytest.fixture
def view(path: Path) -> DoorView:
    return DoorView(sl.read(path).replay())


def test_a_wait_is_answered_once(view: DoorView) -> None:
    """By a change, by its time, or by the end: the first counts."""
    answers: list[Answer] = []
    waits, wait = Waits(), Wait("DOOR_1", DoorState.OPEN, answers.append)
    waits.add(wait)

    waits.look(view)
    waits.look(view)
    waits.end(wait, Answer(value=False))

    assert [Answer(value=True)] == answers


def test_others_wait_on(view: DoorView) -> None:
    """Two that look alike are two."""
    answers: list[Answer] = []
    waits = Waits()
    some = [Wait("DOOR_1", DoorState.CLOSED, answers.append) for _ in range(2)]
    for each in some:
        waits.add(each)

    waits.look(view)
    assert [] == answers
    waits.end(some[0], Answer(value=False))

    assert [Answer(value=False)] == answers
    assert {some[1]} == waits._waiting
