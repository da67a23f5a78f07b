"""What events changed: the map with them, beside the map without."""

from __future__ import annotations

import math
import random
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import KINDS, DoorAnnotated, DoorEvent, Retracted
from semmap_log.core.model.meaning import REGISTERS
from semmap_log.log.replay import change_finder
from semmap_log.log.replay.state import state_at
from semmap_log.store.compaction import compact
from tests.log.replay.test_state import tiny_steps
from tests.test_replay import random_log


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_changes_lead_from_the_map_before_to_the_map_after(seed: int) -> None:
    """Late events, retractions, several writes to a door in a chunk."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder, tiny_steps(), pytest.MonkeyPatch.context() as to:
        to.setattr(change_finder, "FAR", dice.choice([0, 3, 1000]))
        path = Path(folder) / "log"
        told = random_log(path, dice, commits=25)
        if dice.random() < 0.5:
            compact(path)
        log = sl.read(path)
        times = [t for _, happened, recorded, *_ in told for t in (happened, recorded)]
        since, until = sorted([dice.choice(times), dice.choice(times)])
        asked: dict[str, Any] = dice.choice([
            {}, {"since": since, "until": until}, {"kinds": dice.sample(KINDS, 4)},
            {"door": sl.DoorId(dice.randint(1, 4))},
            {"since": since, "until": until, "recorded": True},
        ])  # fmt: skip

        for entry in log.history(**asked):
            assert _expected(log, entry) == {c.field: _plain(c) for c in entry.changes}


def _expected(log: sl.DoorLog, entry: HistoryEntry) -> dict[str, tuple[Any, Any]]:
    """Return field -> (before, after), from two replays."""
    event = entry.event
    if isinstance(event, Retracted) or not isinstance(event, DoorEvent):
        return {}
    before, after = (
        state_at(log._reader, limit=number, uses_keyframes=False)
        for number in (entry.number - 1, entry.number)
    )
    changed = {}
    for register in REGISTERS:
        was, now = (_register(state, event.door_id, register) for state in (before, after))
        for name, value in now.items():
            if was.get(name) != value:
                changed[name] = (was.get(name), value)
    if isinstance(event, DoorAnnotated):
        said = [state.text(event.door_id, event.key) for state in (before, after)]
        texts = [None if one is None else one[1] for one in said]
        if texts[0] != texts[1]:
            changed[event.key] = (texts[0], texts[1])
    return changed


def _register(state: DoorMapState, door_id: int, register: str) -> dict[str, Any]:
    _, (number,), values = state.register_of(np.array([door_id]), register)
    if number < 0:
        return {}
    plain = {name: column[0].item() for name, column in values.items()}
    return {name: None if math.isnan(value) else value for name, value in plain.items()}


def _plain(change: Any) -> tuple[Any, Any]:
    return tuple(
        None if isinstance(value, float) and math.isnan(value)
        else int(value) if isinstance(value, DoorState) else value
        for value in (change.before, change.after)
    )  # type: ignore[return-value]  # fmt: skip


def test_history_says_what_was_before(tmp_path: Path) -> None:
    """A sighting that repeats what is known changes nothing; one that came late, neither."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        place = {"x": 0, "y": 0, "theta": 0, "width": 1}
        door = log.add_door(state="closed", at="2026-03-01T08:00", name="front", **place)
        log.observe(door, "closed", at="2026-03-01T09:00")
        log.observe(door, "open", at="2026-03-01T12:00")
        log.update_door(door, width=0.8, state="closed", at="2026-03-01T10:00")
        log.update_door(door, state="closed", at="2026-03-01T13:00")
        log.annotate(door, "name", "main")

        changes = [[(c.field, c.before, c.after) for c in e.changes] for e in log.history(door)]

    assert ("state", None, DoorState.CLOSED) in changes[0]
    assert [
        [("name", None, "front")],
        [],
        [("state", DoorState.CLOSED, DoorState.OPEN)],
        [("width", 1, 0.8)],
        [("state", DoorState.OPEN, DoorState.CLOSED)],
        [("name", "front", "main")],
    ] == changes[1:]
