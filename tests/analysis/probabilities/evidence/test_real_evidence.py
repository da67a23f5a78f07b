"""Evidence of real doors: open by time, not by events; outages are not known time."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.probabilities.evidence.day_tables import day_tables
from semmap_log.analysis.probabilities.evidence.evidence import EvidenceProjection
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.interop.importing.importing import ImportOptions, import_file

DAY_NS = 86_400 * 10**9


@pytest.fixture(scope="module")
def workshop(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    """Three years of a workshop's door, with outages of 38, 21 and 15 days."""
    path, data = tmp_path_factory.mktemp("workshop") / "log", shared_data / "doors/workshop_3y"
    with sl.create(path, tz="Europe/Oslo", durability="none") as log:
        import_file(log, data / "doors.csv.gz", ImportOptions(windows=data / "obs_windows.csv"))
    return sl.read(path)


@pytest.mark.slow
def test_a_door_is_open_by_time_and_not_by_events(workshop: sl.DoorLog) -> None:
    """Half of the events say OPEN, and .179 of the known time is."""
    evidence = workshop.fold(EvidenceProjection())
    (door,) = evidence.door_ids

    found = evidence.door(door)
    tables = day_tables(found, LocalClock("Europe/Oslo"))

    lasts_ns = found.end_ns - found.start_ns
    assert pytest.approx(0.179, abs=0.0005) == lasts_ns[found.is_open].sum() / lasts_ns.sum()
    assert pytest.approx(0.179, abs=0.0005) == tables.open_h.sum() / tables.known_h.sum()
    assert 0.5 == pytest.approx(found.is_open.mean(), abs=0.001)


def test_outages_are_known_to_be_unknown(workshop: sl.DoorLog) -> None:
    """Three gaps of weeks, which no state reaches into."""
    evidence = workshop.fold(EvidenceProjection())
    (door,) = evidence.door_ids

    found = evidence.door(door)

    gaps = (found.start_ns[1:] - found.end_ns[:-1]) / DAY_NS
    assert [15, 21, 38] == pytest.approx(sorted(gaps[gaps > 7].tolist()), abs=1)
