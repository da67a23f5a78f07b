"""The hypotheses: how likely each is, how wide open, and where its leaves stand."""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np
import pytest

from semmap_log.analysis.scans.leaves import PRIOR, Leaves, leaves_of

KINDS = ["", "hinged", "double", "sliding", "folding"]
LINE = np.array([10.0, 20.0, pi / 2, 2.0])
"""Points along y: what is left of it has smaller x."""


def row_of(leaves: Leaves, *segments: tuple[float, float, float, float]) -> int:
    """Return which hypothesis has these leaves on `LINE`."""
    rows = [leaves.on_map(row, LINE) for row in range(len(leaves.clear))]
    same = [i for i, row in enumerate(rows) if len(row) == len(segments) and row]
    return next(i for i in same if np.allclose(rows[i], segments))


@pytest.mark.parametrize("kind", KINDS)
def test_words_share_the_prior_whatever_the_kind(kind: str) -> None:
    leaves = leaves_of(kind)
    prior = np.exp(leaves.log_prior)

    assert prior[leaves.shut].sum() == pytest.approx(PRIOR["shut"])
    assert prior[leaves.ajar].sum() == pytest.approx(PRIOR["ajar"])
    assert prior[leaves.open].sum() == pytest.approx(PRIOR["open"])
    assert ((leaves.clear >= 0) & (leaves.clear <= 1)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_can_be_shut_and_gone(kind: str) -> None:
    leaves = leaves_of(kind)
    gone = (leaves.lengths == 0).all(1)

    assert [1.0] == leaves.clear[gone].tolist()
    assert 0.0 == leaves.clear.min()


def test_a_hinged_door_has_leaves_at_both_ends_to_both_sides() -> None:
    leaves = leaves_of("hinged")

    assert leaves.clear[row_of(leaves, (10, 20, 10, 22))] == 0
    in_line, across = 2 * cos(radians(36)), 2 * cos(radians(54))
    for segment in [
        (10, 20, 10 - across, 20 + in_line),
        (10, 20, 10 + across, 20 + in_line),
        (10, 22, 10 - across, 22 - in_line),
        (10, 22, 10 + across, 22 - in_line),
    ]:
        assert leaves.clear[row_of(leaves, segment)] == pytest.approx(1 - cos(radians(36)))


def test_the_leaves_of_a_double_door_stand_each_by_itself() -> None:
    leaves = leaves_of("double")

    one_open = row_of(leaves, (10, 20, 10, 21), (10, 22, 9, 22))

    assert leaves.clear[one_open] == pytest.approx(0.5)
    assert leaves.open[one_open]
    assert leaves.shut[row_of(leaves, (10, 20, 10, 21), (10, 22, 10, 21))]


def test_a_sliding_leaf_goes_to_either_end_or_two_part() -> None:
    leaves = leaves_of("sliding")

    for segments in [[(10, 20, 10, 21.5)], [(10, 20.5, 10, 22)]]:
        assert leaves.clear[row_of(leaves, *segments)] == pytest.approx(0.25)
    parted = row_of(leaves, (10, 20, 10, 20.75), (10, 21.25, 10, 22))
    assert leaves.clear[parted] == pytest.approx(0.25)


def test_the_panels_of_a_folding_door_meet() -> None:
    leaves = leaves_of("folding")
    panels = [leaves.on_map(row, LINE) for row in range(len(leaves.clear))]
    folded = [row for row in panels if len(row) == 2]

    assert 20 == len(folded)
    for first, second in folded:
        assert first[2:] == pytest.approx(second[:2], abs=1e-6), "the panels' joint"
        assert second[2] == pytest.approx(10, abs=1e-6), "the free edge runs in the line"


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("double_hinged", "double"), ("double_swing", "double"), ("double_sliding", "sliding"),
        ("single_sliding", "sliding"), ("double_telescope", "sliding"), ("single_swing", "hinged"),
        ("Bifold", "folding"), ("", "hinged"), ("HINGED ", "hinged"), ("revolving", "hinged"),
    ],
)  # fmt: skip
def test_other_names_of_a_kind_are_known(name: str, kind: str) -> None:
    """What is not known is hinged."""
    assert leaves_of(kind).clear.tolist() == leaves_of(name).clear.tolist()


@pytest.mark.parametrize("kind", KINDS)
def test_rows_with_most_leaves_come_first(kind: str) -> None:
    leaves = leaves_of(kind)
    counts = (leaves.lengths > 0).sum(1)[: len(leaves.clear) - len(leaves.both)]

    assert sorted(counts.tolist(), reverse=True) == counts.tolist()
    assert [int((counts > k).sum()) for k in range(counts.max())] == list(leaves.with_leaf)


def test_a_leaf_may_stand_before_a_wall() -> None:
    """Which is no leaf itself, and stands across the line at the other end."""
    leaves = leaves_of("hinged")

    walled = np.isin(np.arange(len(leaves.clear)), leaves.both[:, 0])
    assert walled[leaves.ajar].sum() == leaves.ajar.sum() / 2
    assert leaves.open[walled].any(), "one that is open may, too: else a wall spoke for ajar"
    for both, leaf, wall in leaves.both.tolist():
        assert leaves.on_map(both, LINE) == leaves.on_map(leaf, LINE) != ()
        assert () == leaves.on_map(wall, LINE)
        assert leaves.clear[both] == leaves.clear[leaf] < leaves.clear[wall] == 1
        assert leaves.starts[leaf, 0, 0] != leaves.starts[wall, 0, 0], "at the other end"
        assert sin(leaves.turns[leaf, 0]) * sin(leaves.turns[wall, 0]) > 0, "on the same side"


@pytest.mark.parametrize("kind", ["double", "hinged"])
def test_a_leaf_hardly_off_its_line_is_shut(kind: str) -> None:
    """A leaf that is hung a little off the line looks as if it stood a little open."""
    leaves = leaves_of(kind)
    turned = np.abs(np.sin(leaves.turns)) * (leaves.lengths > 0)
    little = (turned < sin(radians(15))).all(1) & (leaves.lengths.sum(1) == 1)

    assert 1 < little.sum()
    assert leaves.shut[little & ~leaves.standing].all()


def test_a_sliding_leaf_runs_in_the_wall_or_hangs_before_it() -> None:
    leaves = leaves_of("sliding")

    for off in (0, 0.2, -0.2):
        assert leaves.shut[row_of(leaves, (10 - off, 20, 10 - off, 22))]


def test_somebody_who_stands_in_the_door_is_no_leaf_of_it() -> None:
    leaves = leaves_of("hinged")

    assert 3 == leaves.standing.sum()
    assert leaves.open[leaves.standing].all()
    assert {()} == {leaves.on_map(row, LINE) for row in np.flatnonzero(leaves.standing).tolist()}
