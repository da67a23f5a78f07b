"""Whole files missing, doubled, renamed, exchanged, foreign; and what else lies in the folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from fault_injection.fault import Plan
from fault_injection.sample import Sample
from fault_injection.segments import closed_early, segments

import semmap_log as sl
from semmap_log.errors import CorruptLogError


@pytest.mark.slow
def test_no_file_out_of_place_gives_a_wrong_answer(plan: Plan) -> None:
    """
    Everything that `tools/faults.py segments` does, reading and appending.
    """
    outcomes = list(segments(plan))

    assert [] == [outcome for outcome in outcomes if not outcome.is_good]
    assert 400 < len(outcomes)


@pytest.mark.parametrize("name", ["log_000000.mcap", "log_000001.mcap"])
def test_a_missing_segment_is_named_by_its_number(
    name: str, sample: Sample, tmp_path: Path
) -> None:
    """
    Opening says which one, and where the gap shows.
    """
    log = tmp_path / "log"
    shutil.copytree(sample.closed, log)
    (log / name).unlink()

    with pytest.raises(CorruptLogError, match=f"expected segment {int(name[4:10])} .*missing"):
        sl.read(log)


def test_a_middle_segment_that_ends_early_answers_no_question(
    sample: Sample, tmp_path: Path
) -> None:
    """
    Closed, whole by all its checksums, and of an earlier day: no question passes over the gap.
    """
    early = closed_early(sample, tmp_path / "early")
    log = tmp_path / "log"
    shutil.copytree(sample.closed, log)
    shutil.copy2(early / "log_000001.mcap", log)
    gone = sample.commits[9]

    for ask in (
        lambda: list(sl.read(log).batches()),
        lambda: list(sl.read(log).commits()),
        lambda: sl.read(log).replay(known_at=gone.recorded_ns),
        lambda: sl.read(log).event(gone.first_event),
    ):
        with pytest.raises(CorruptLogError, match="log_00000"):
            ask()
