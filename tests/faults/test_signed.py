"""Signed logs attacked without their keys: the exit code of each attack of the list."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from fault_injection.signed import scene_of, try_attack
from fault_injection.signed_logs.attacks import ATTACKS, Attack
from fault_injection.signed_logs.sample import SignedSample, make_signed

from semmap_log.log.replay.maintenance import verify
from semmap_log.log.signing.signed_log import verify_signed
from tests.faults.running import faults, is_tried


@pytest.fixture(scope="module")
def signed_sample(tmp_path_factory: pytest.TempPathFactory) -> SignedSample:
    return make_signed(tmp_path_factory.mktemp("signed"))


def test_a_log_that_nobody_attacks_is_good(signed_sample: SignedSample) -> None:
    """At each stage of its trimming, with and without the keys."""
    for log in (*signed_sample.stages, signed_sample.log):
        found = verify_signed(log, signed_sample.trusted)
        assert (0, found.statements) == (found.found.exit_code, found.good + found_gone(found))
        assert 0 == verify(log).exit_code


def found_gone(found) -> int:  # type: ignore[no-untyped-def]
    """Return how many statements are about commits that were taken out since."""
    return sum(one.kind == "removed" for one in found.found.findings)


@pytest.mark.parametrize("one", ATTACKS, ids=lambda one: one.name.replace(" ", "_"))
def test_each_attack_has_its_exit_code(
    signed_sample: SignedSample, memory: Path, one: Attack
) -> None:
    with scene_of(signed_sample, memory / "room", random.Random(one.name)) as scene:
        assert "" == try_attack(one, scene)


@pytest.mark.slow
def test_at_random_places(tmp_path: Path) -> None:
    is_tried(faults("signed", 2 * len(ATTACKS), tmp_path), at_least=2 * len(ATTACKS))
