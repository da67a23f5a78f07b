"""Two real buildings whose truth was set by eye; doors that change are put into them."""

from __future__ import annotations

from pathlib import Path

import pytest
from eval_scans import scores, virtual_visits

from scan_eval.packed_logs import PackedLog, Told
from scan_eval.visit_scores import counts, ece, plain_counts, undecided_share, wrong_share

pytestmark = pytest.mark.slow
LOGS = ["freiburg-079", "intel"]


@pytest.fixture(scope="module", params=LOGS)
def log(request: pytest.FixtureRequest, shared_data: Path) -> PackedLog:
    return PackedLog.read(shared_data / "scans" / f"{request.param}.npz")


def test_no_decided_visit_is_wrong_and_few_are_undecided(log: PackedLog) -> None:
    found = scores(log, Told(), seeds=0)

    assert 0 == found["wrong"]
    assert found["undecided"] < 0.05
    assert found["ece"] < 0.02
    assert abs(found["said_accuracy"] - 1) < 0.016
    assert found["passed"] >= 8


def test_virtual_leaves_are_read_better_than_by_the_plain_rule(log: PackedLog) -> None:
    visits = virtual_visits(log, Told(), seed=100)

    assert wrong_share(visits) <= 0.01
    assert undecided_share(visits) < 0.15
    assert ece(visits) < 0.05
    read, plain = counts(visits, "ajar"), plain_counts(visits, "ajar")
    assert read["OPEN"] < plain["OPEN"]
