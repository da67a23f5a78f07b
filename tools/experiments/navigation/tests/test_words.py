"""What is said follows from the figures: other figures, other words."""

from __future__ import annotations

from pathlib import Path

import pytest

from navigation.records import RunKey
from navigation.tables.figures import RunFigures
from navigation.tables.grouped import GroupedRuns
from navigation.tables.words import words_of


def run(
    setup: str, seed: int, after: int, *, total_s: float = 20_000.0, **options: float
) -> RunFigures:
    """Return a run that reached 100 of 200 goals, so many of the others after driving."""
    return RunFigures(
        key=RunKey("clinic", setup, "fixed", seed), options=options, took_s=(50.0,) * 100,
        total_s=total_s, tried=200, unreachable=100, after_driving=after, on_the_spot=0,
        in_vain_s=30.0 * after, path_m=1000.0, wrong=0.1, told=20, folder=Path(),
    )  # fmt: skip


def said(**after: list[int]) -> str:
    """Return what is said of setups with so many goals after driving in each run."""
    runs = [run(setup, n, k) for setup, counts in after.items() for n, k in enumerate(counts, 1)]
    return "\n".join(words_of(GroupedRuns(runs), "clinic"))


MANY, FEW, NONE = [40, 44, 48, 36, 42], [2, 1, 3, 2, 2], [0, 0, 0, 0, 0]


@pytest.mark.parametrize(
    ("without", "with_map", "expected"),
    [
        (MANY, FEW, "map of doors helps: without it 21.0 % (±"),
        (MANY, NONE, "0.00 % (at most 0.30), at least "),
        (FEW, MANY, "map of doors does harm"),
        (FEW, FEW, "makes no difference that these runs can show"),
    ],
)
def test_without_obstacles(without: list[int], with_map: list[int], expected: str) -> None:
    """
    The map alone against nothing at all.
    """
    assert expected in said(no_map_star=without, map_star=with_map)


@pytest.mark.parametrize(
    ("without", "with_map", "expected"),
    [
        ([5, 6, 7, 5, 6], [1, 2, 2, 1, 1], "still helps, by 2.20 points (±"),
        ([1, 2, 2, 1, 1], [5, 6, 7, 5, 6], "does harm, by 2.20 points (±"),
        ([5, 1, 7, 2, 6], [1, 6, 2, 7, 5], "makes no difference that these runs can show"),
    ],
)
def test_with_obstacles(without: list[int], with_map: list[int], expected: str) -> None:
    """
    By pairs of the same seed.
    """
    assert expected in said(no_map=without, map=with_map)


def test_each_setup_that_is_there_is_told_of() -> None:
    """
    And no other.
    """
    words = said(map=FEW, map_star=MANY, smart=NONE, belief=FEW, patrol=FEW, nearest_first=MANY)

    for setup in (
        "(Map*) is worse than",
        "(Smart): 21.00 points",
        "(Belief): 20.00 points",
        "(Patrol)",
    ):
        assert setup in words
    assert "No Map" not in words
    assert "no difference in time that shows (+0.0 ±0.0 min a run)" in words


def test_a_quicker_order_is_called_quicker() -> None:
    """
    In minutes a run.
    """
    runs = [
        run(setup, seed, 2, total_s=seconds + 60 * seed)
        for setup, seconds in (("patrol", 6000), ("nearest_first", 9000))
        for seed in (1, 2, 3)
    ]

    (told,) = [line for line in words_of(GroupedRuns(runs), "clinic") if "Patrol" in line]
    assert "a run is 50.0 min (±0.0) shorter" in told


@pytest.mark.parametrize(
    ("counts", "expected"),
    [
        (MANY, "holds the thesis's 22.37 %"),
        (FEW, "lies below the"),
        ([90, 92, 94, 91, 93], "lies above"),
    ],
)
def test_beside_the_thesis(counts: list[int], expected: str) -> None:
    """
    Whether the interval holds its figure.
    """
    assert expected in said(no_map_star=counts)


def test_nearness_is_told_where_it_was_swept() -> None:
    """
    Nearest first, whatever the usual one is.
    """
    runs = [
        run(setup, seed, count, near_m=near)
        for near, setup, count in (
            (3.0, "map", 2), (3.0, "map_star", 2), (1.0, "map", 2), (1.0, "map_star", 20),
        )
        for seed in range(1, 6)
    ]  # fmt: skip

    (told,) = [line for line in words_of(GroupedRuns(runs), "clinic") if "How near" in line]
    assert "at 1 m 10.00 and 1.00 %, 10 times (10 to 10); at 3 m 1.00 and" in told
    assert told.endswith("1.00 %, no difference that shows.")


def test_shares_are_of_the_seeds_that_are_compared() -> None:
    """
    Not of those that only one setup has: their difference is that of the points.
    """
    words = said(smart=[1, 2, 1], map_star=[3, 4, 4, 90, 90])

    assert "(Smart): 1.17 points" in words
    assert "0.67 % (±0.72) against 1.83 % (±0.72)" in words


def test_other_options_are_told_by_their_values() -> None:
    """
    Where there is more than one run of it; beside the usual value over the same seeds.
    """
    runs = [run("map", seed, 2 if seed < 4 else 90, margin_m=0.0) for seed in range(1, 6)]
    runs += [run("map", seed, 8, margin_m=0.1) for seed in range(1, 4)]
    runs += [run("map", 1, 9, margin_m=0.2)]

    told = [line for line in words_of(GroupedRuns(runs), "clinic") if "margin_m" in line]

    assert told == ["With margin_m 0.1 in place of 0.0: Map 4.00 % (±0.00) for 1.00 %."]


def test_one_run_is_no_evidence() -> None:
    """
    It is said so.
    """
    assert "nothing can be said" in said(no_map=[3], map=[1])
