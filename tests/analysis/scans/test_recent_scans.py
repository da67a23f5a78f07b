"""Scans wait until the visits end that they are of."""

from __future__ import annotations

from dataclasses import replace

from semmap_log.analysis.scans.visit import RecentScans
from tests.analysis.scans.some_scans import some_scan
from tests.analysis.scans.some_visits import START_NS, S, some_visit


def test_a_visit_finds_its_scans() -> None:
    """Those of its own laser and robot, from its first to its last."""
    recent = RecentScans()
    for second in range(8):
        for robot in ("a", "b"):
            recent.take(some_scan(START_NS + second * S, 0.0, 0.0, robot=robot, beams=3))
    visit = some_visit(at_s=2.0, laser="laser", robot="b")

    found = recent.of(visit)

    assert [scan.stamp_ns - START_NS for scan in found] == [n * S for n in range(2, 7)]
    assert {scan.robot for scan in found} == {"b"}
    assert recent.of(replace(visit, laser="another")) == []


def test_old_scans_are_let_go() -> None:
    """A robot scans for weeks."""
    recent = RecentScans(kept_ns=3 * S)
    for second in range(10):
        recent.take(some_scan(START_NS + second * S, 0.0, 0.0, beams=3))
    recent.forget_old()
    visit = replace(some_visit(laser="laser"), first_ns=0, last_ns=START_NS + 100 * S)

    assert [scan.stamp_ns - START_NS for scan in recent.of(visit)] == [n * S for n in (6, 7, 8, 9)]


def test_scans_of_before_a_clock_was_set_back_are_let_go() -> None:
    """Else they would be held until the clock is there again."""
    recent = RecentScans(kept_ns=3 * S)
    for second in (1000, 1001, 1002, 10, 11):
        recent.take(some_scan(START_NS + second * S, 0.0, 0.0, beams=3))
    recent.forget_old()
    visit = replace(some_visit(laser="laser"), first_ns=0, last_ns=START_NS + 2000 * S)

    assert [scan.stamp_ns - START_NS for scan in recent.of(visit)] == [10 * S, 11 * S]
