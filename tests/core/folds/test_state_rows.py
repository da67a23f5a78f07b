"""The writes to states as rows: which of them are sightings, and how accurate those are."""

from __future__ import annotations

from semmap_log.core.folds.registers import state_rows
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorUpdated
from semmap_log.core.model.meaning import Changed
from tests.batches import batch_of


def test_a_sighting_has_its_accuracies_among_other_writes() -> None:
    """Those of other sightings and of what was set are not taken for its own."""
    batch = batch_of(
        [
            DoorAdded(door_id=1, state=DoorState.CLOSED),
            DoorObserved(door_id=1, state=DoorState.OPEN, accuracy_open=0.9, accuracy_closed=0.8),
            DoorUpdated(door_id=1, changed=Changed.STATE, state=DoorState.CLOSED),
            DoorObserved(door_id=1, state=DoorState.OPEN, accuracy_open=0.7, accuracy_closed=0.6),
        ]
    )

    rows = state_rows([batch])
    seen = rows[rows["is_sighting"]]
    seen.sort(order="number")

    assert [(0.9, 0.8), (0.7, 0.6)] == list(
        zip(seen["accuracy_open"], seen["accuracy_closed"], strict=True)
    )
    assert [1, 3] == seen["number"].tolist()
