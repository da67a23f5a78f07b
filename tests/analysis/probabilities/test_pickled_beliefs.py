"""Beliefs that go to another process."""

from __future__ import annotations

import pickle

import numpy as np

from semmap_log.analysis.probabilities.belief_fold import Beliefs, by_name
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.telling import DOOR, added, ns_of, seen, told_of


def test_beliefs_that_have_learnt_can_be_sent() -> None:
    """After a question was answered they are pickled as before it, and answer the same."""
    told = told_of(added(), seen("open", 60), seen("closed", 3600))
    beliefs = Beliefs(by_name("filter"), LocalClock("UTC"), told)
    at_ns = np.array([ns_of(7200)])
    expected = beliefs.predict(DOOR, at_ns)

    sent = pickle.loads(pickle.dumps(beliefs))

    assert expected.p_open.tolist() == sent.predict(DOOR, at_ns).p_open.tolist()
