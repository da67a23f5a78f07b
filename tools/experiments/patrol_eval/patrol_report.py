"""What the trials say, paired by seed: how ours differs from each other planner, and how surely."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

T_95 = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13)
"""Student's t, two-sided 95 %, for 1, 2, … degrees of freedom; beyond, about 2."""
Trial = Mapping[str, Any]

FIGURES = {
    "failed approaches": ("failed", None),
    "failed, workdays": ("failed_workdays", None),
    "mean time to visit": ("latency_s", "reachable"),
    "last reachable visited": ("last_s", "rounds"),
    "driving": ("driving_s", "rounds"),
    "visits": ("visited", None),
}
"""Figure -> its sum, and what that is divided by."""


def report(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return for each week the means of each planner, and ours against the others, in percent."""
    planners = list(trials[0]["planners"])
    weeks = range(len(trials[0]["planners"][planners[0]]))
    return {
        "seeds": [trial["seed"] for trial in trials],
        "weeks": [
            {
                "means": {
                    name: {
                        **{figure: _mean(trials, name, week, figure) for figure in FIGURES},
                        "reachable visited": float(np.mean(_reached(trials, name, week))),
                    }
                    for name in planners
                },
                "differences": {
                    f"{ours} against {other}": _against(trials, ours, other, week)
                    for ours in planners
                    for other in planners
                    if ours not in BASES and other not in {ours, "true"}
                },
            }
            for week in weeks
        ],
    }


BASES = ("fixed", "nearest")


def _against(trials: Sequence[Trial], ours: str, other: str, week: int) -> dict[str, Any]:
    """Return differences, percent of the other's, with half the width of the 95 % interval."""
    found = {}
    for figure in FIGURES:
        mine = np.array([_value(trial, ours, week, figure) for trial in trials])
        theirs = np.array([_value(trial, other, week, figure) for trial in trials])
        found[figure] = interval((mine / theirs - 1) * 100)
    points = (np.array(_reached(trials, ours, week)) - _reached(trials, other, week)) * 100
    found["reachable visited, points"] = interval(points)
    return found


def interval(values: Sequence[float] | np.ndarray) -> dict[str, float]:
    """Return a mean and half the width of its 95 % interval; nan of one value."""
    values = np.asarray(values, np.float64)
    count = len(values)
    half = math.nan
    if count > 1:
        t = T_95[count - 2] if count - 2 < len(T_95) else 2.0 + 2.5 / count
        half = t * float(values.std(ddof=1)) / math.sqrt(count)
    return {"mean": float(values.mean()), "half_width": half}


def _mean(trials: Sequence[Trial], planner: str, week: int, figure: str) -> float:
    return float(np.mean([_value(trial, planner, week, figure) for trial in trials]))


def _value(trial: Trial, planner: str, week: int, figure: str) -> float:
    total, by = FIGURES[figure]
    sums = trial["planners"][planner][week]
    return float(sums[total] / (1 if by is None else max(sums[by], 1)))


def _reached(trials: Sequence[Trial], planner: str, week: int) -> list[float]:
    sums = [trial["planners"][planner][week] for trial in trials]
    return [each["reached"] / max(each["reachable"], 1) for each in sums]


def print_report(found: Mapping[str, Any]) -> None:
    """Print it for people."""
    for number, week in enumerate(found["weeks"], start=1):
        print(f"\nweek {number}, {len(found['seeds'])} seeds")
        names = list(week["means"])
        print(f"  {'':26}" + "".join(f"{name:>12}" for name in names))
        for figure in [*FIGURES, "reachable visited"]:
            digits = 3 if figure == "reachable visited" else 1
            row = "".join(f"{week['means'][name][figure]:12.{digits}f}" for name in names)
            print(f"  {figure:26}{row}")
        for pair, differences in week["differences"].items():
            print(f"  {pair}, paired, 95 % interval:")
            for figure, each in differences.items():
                unit = "" if "points" in figure else " %"
                print(f"    {figure:26}{each['mean']:+8.1f} +- {each['half_width']:.1f}{unit}")
