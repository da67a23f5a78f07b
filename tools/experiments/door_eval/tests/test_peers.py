"""Estimators that are programs of their own: what they are told, answer, and do wrong."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from door_eval.peers import Peer
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.errors import EstimatorError

DOOR, CLOCK = DoorId(7), LocalClock("UTC")
HOUR_NS = 3600 * SECOND_NS
SAYS_WHAT_IT_SAW = """
import json, sys
import numpy as np

for line in sys.stdin:
    question = json.loads(line)
    told = np.load(question["ask"])
    assert len(told["seen_ns"]) == len(told["accuracy_open"]) == len(told["accuracy_closed"])
    seen = np.searchsorted(told["seen_ns"], told["known_ns"], "right")
    before = np.concatenate([[0], np.cumsum(told["reads_open"])])[seen]
    p_open = (before - told["seen_ns"].max() / 1e17) / np.maximum(seen, 1)
    np.save(question["answer"], p_open)
    print(json.dumps({"door": question["door"]}), flush=True)
"""


def evidence(reads_open: list[bool]) -> Evidence:
    """Return a sighting an hour, from the first hour of 1970 on."""
    found = Evidence()
    times_ns = np.arange(1, len(reads_open) + 1) * HOUR_NS
    found.apply(EventBatch.of(DoorAdded, happened_ns=times_ns[:1], door_id=DOOR))
    state = np.where(reads_open, DoorState.OPEN, DoorState.CLOSED).astype(np.uint8)
    found.apply(
        EventBatch.of(
            DoorObserved,
            happened_ns=times_ns,
            door_id=DOOR,
            state=state,
            accuracy_open=0.9,
            accuracy_closed=0.8,
        )
    )
    return found


def program(folder: Path, text: str) -> str:
    path = folder / "peer.py"
    path.write_text(text)
    return f"{sys.executable} {path}"


def test_a_peer_is_asked_as_an_estimator_is(tmp_path: Path) -> None:
    """
    It is told the sightings up to the last time that a forecast may know, and none behind it.
    """
    known_ns = np.array([1, 3]) * HOUR_NS
    with Peer("counter", program(tmp_path, SAYS_WHAT_IT_SAW)) as peer:
        learnt = peer.learn(evidence([True, False, False, True, True]).up_to(), CLOCK)

        found = learnt.predict(DOOR, known_ns + HOUR_NS, known_ns)
        again = learnt.predict(DOOR, known_ns + HOUR_NS, known_ns)
        nothing = learnt.predict(DoorId(8), known_ns, known_ns)

    last = 3 * HOUR_NS / 1e17
    assert pytest.approx([min(1 - last, 0.999), (1 - last) / 3]) == found.p_open
    assert found.p_open.tolist() == again.p_open.tolist()
    assert found.is_known.all()
    assert not nothing.is_known.any()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("raise SystemExit(3)", "ended with code 3 when it was asked about door 7"),
        ("input(); print('{\"error\": \"too far ahead\"}')", "door 7: too far ahead"),
        ("input(); print('good morning')", "expected a JSON line, got 'good morning'"),
        ("input(); print('{\"door\": 7}')", "door 7: wrote no answer"),
        (SAYS_WHAT_IT_SAW.replace("p_open)", "p_open[:1])"), "expected 2 numbers in 0..1"),
        (SAYS_WHAT_IT_SAW.replace("p_open)", "p_open - 1)"), "expected 2 numbers in 0..1"),
    ],
)  # fmt: skip
def test_what_a_peer_does_wrong_is_said(tmp_path: Path, text: str, said: str) -> None:
    """
    With its name, and the door.
    """
    known_ns = np.array([1, 3]) * HOUR_NS
    with Peer("rude", program(tmp_path, text)) as peer:
        learnt = peer.learn(evidence([True, False, False]).up_to(), CLOCK)

        with pytest.raises(EstimatorError, match=rf"peer rude: .*{said}"):
            learnt.predict(DOOR, known_ns, known_ns)


def test_a_peer_that_is_not_there() -> None:
    """
    Said at once, not at the first door.
    """
    with (
        pytest.raises(EstimatorError, match="peer ghost: cannot be started"),
        Peer("ghost", "./no"),
    ):
        pass
