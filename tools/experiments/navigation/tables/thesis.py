"""The figures of the thesis's own runs, as its appendix E.2 prints them.

"A Semantic Map Implementation for a Long-Term Autonomous Robot", bachelor's thesis, TU Graz: tables
RUNTIMES and NUMBER OF GOALS of E.2.1 (`random`: two runs a setup, added up) and E.2.2 (`fixed`: one
run a setup). It has no intervals. How it averaged two runs is not told: 200 goals of No Map in
53,519 s would be 268 s each, where it prints 121.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ThesisRow:
    """A setup's row of RUNTIMES and of NUMBER OF GOALS; times in seconds, shares in percent."""

    total_s: float
    for_goals_s: float
    average_s: float
    average_percent: float
    slowest_s: float
    slowest_percent: float
    tried: int
    after_driving: int
    percent: float
    fastest_s: float = 0.0
    fastest_percent: float = 0.0


RUNS = {"random": 2, "fixed": 1}
"""So many runs a row adds up."""

THESIS = {
    "random": {
        "no_map": ThesisRow(66181, 53519, 121, 0.18, 27366, 41.35, 582, 40, 6.87),
        "map": ThesisRow(37794, 22387, 96, 0.25, 301, 0.80, 864, 55, 6.37),
        "no_map_star": ThesisRow(57162, 23279, 113, 0.2, 319, 0.56, 1665, 187, 11.23),
        "map_star": ThesisRow(65695, 42981, 109, 0.17, 21728, 33.07, 1707, 71, 4.16),
    },
    "fixed": {
        "no_map": ThesisRow(21629, 11885, 118, 0.55, 278, 1.29, 511, 20, 3.91),
        "map": ThesisRow(20387, 13833, 138, 0.68, 349, 1.71, 372, 11, 2.96),
        "no_map_star": ThesisRow(20006, 11565, 115, 0.58, 264, 1.32, 219, 49, 22.37),
        "map_star": ThesisRow(20036, 10841, 108, 0.54, 256, 1.28, 383, 36, 9.4),
    },
}
"""By series and setup."""
