"""The fold of a scope: its own, whoever is asked."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorObserved
from semmap_log.log.replay.replay import Scope


@pytest.fixture
def log(tmp_path: Path):
    with sl.create(tmp_path / "log", tz="UTC") as opened:
        opened.add_door(
            x=1.0, y=2.0, theta=0.0, width=0.9, prob_open=0.5, prob_closed=0.5, name="front"
        )
        opened.observe("front", "open")
        yield opened


@pytest.mark.parametrize("scope", [Scope(), Scope(event=1)])
def test_who_folds_on_changes_nothing_else(log: sl.DoorLogWriter, scope: Scope) -> None:
    """Neither the writer's map, nor what is asked next."""
    before = log.door_map()
    state = log.state_in(scope)
    doors = state.door_map()

    state.apply(sl.EventBatch.of(DoorObserved, door_id=[1], state=4, happened_ns=2 * 10**18))
    state.apply_one(
        DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.MOVING, happened_ns=3 * 10**18), 99
    )

    assert before == log.door_map() == log.replay()
    assert doors == log.state_in(scope).door_map()


def test_it_is_the_same_of_one_that_is_written_and_one_that_is_read(log: sl.DoorLogWriter) -> None:
    """Of now, and of a moment."""
    read = sl.read(log.path)

    for scope in (Scope(), Scope(event=0), log.scope(at="now")):
        assert read.state_in(scope).door_map() == log.state_in(scope).door_map()
