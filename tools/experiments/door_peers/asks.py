"""What a peer is asked, as sequences of readings; and the loop that answers. Numpy only."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SECOND_NS = 10**9
SAMPLED_EACH_S = 600
"""A state that is known all through is read so often."""
SURE = 0.99
"""So often such a reading is right: the P_M and P_F of 0.01 in Perpetua's examples."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Readings:
    """What was read of one door, in order of time."""

    times_s: Floats
    """(n,), seconds since `Ask.zero_ns`."""
    reads_open: NDArray[np.bool_]
    """(n,)."""
    missed: Floats
    """(n,), P_M: P(reads closed | open)."""
    false: Floats
    """(n,), P_F: P(reads open | closed)."""

    def __len__(self) -> int:
        return len(self.times_s)

    def __getitem__(self, chosen: slice) -> Readings:
        return Readings(
            self.times_s[chosen], self.reads_open[chosen], self.missed[chosen], self.false[chosen]
        )

    def p_reads_open(self, p_open: Floats, at: NDArray[np.intp]) -> Floats:
        """Return P(reads open) of some readings where the door is open with `p_open`."""
        return p_open * (1 - self.missed[at]) + (1 - p_open) * self.false[at]


@dataclass(frozen=True)
class Ask:
    """Forecasts of one door that are asked for, and what is known of it."""

    series: tuple[int, int, int]
    """The same for the same visits to a door, whatever was read: which door, when they begin, and
    how far apart they usually are, seconds."""
    readings: Readings
    times_s: Floats
    """(m,), of the forecasts."""
    last: NDArray[np.intp]
    """(m,), the last reading that each may know; -1: none."""
    training: int
    """So many readings every forecast may know: settings are learnt from these."""

    @classmethod
    def load(cls, door: int, path: str) -> Ask:
        """Return what a file asks; states that are known all through are sampled."""
        with np.load(path) as told:
            columns = dict(told)
        zero_ns = _first_ns(columns)
        readings = _readings(columns, zero_ns)
        known_s = (columns["known_ns"] - zero_ns) / SECOND_NS
        last = np.searchsorted(readings.times_s, known_s, "right") - 1
        times_s = (columns["times_ns"] - zero_ns) / SECOND_NS
        training = int(last.min(initial=len(readings))) + 1
        spacing_s = np.median(np.diff(readings.times_s)) if len(readings) > 1 else 0.0
        return cls((door, zero_ns, round(float(spacing_s))), readings, times_s, last, training)

    @property
    def ahead_s(self) -> float:
        """How far behind the last reading forecasts usually are."""
        known = self.last >= 0
        if not known.any():
            return 0.0
        return float(np.median(self.times_s[known] - self.readings.times_s[self.last[known]]))


def answer_all(predict: Callable[[Ask], Floats]) -> None:
    """Answer each line of the standard input until it ends; what fails is told as an error."""
    for line in sys.stdin:
        question = json.loads(line)
        try:
            p_open = predict(Ask.load(question["door"], question["ask"]))
            np.save(question["answer"], np.clip(p_open, 0.0, 1.0))
            said = {"door": question["door"]}
        except Exception as error:  # noqa: BLE001 - whatever it is, who asks is told
            said = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(said), flush=True)


def _first_ns(columns: dict[str, NDArray[np.int64]]) -> int:
    firsts = [int(columns[name][0]) for name in ("start_ns", "seen_ns") if len(columns[name])]
    return min(firsts, default=0)


def _readings(columns: dict[str, NDArray[np.int64]], zero_ns: int) -> Readings:
    step_ns = SAMPLED_EACH_S * SECOND_NS
    first, end = -(-columns["start_ns"] // step_ns), -(-columns["end_ns"] // step_ns)
    count = end - first
    before = np.cumsum(count) - count
    steps = np.arange(int(count.sum())) - np.repeat(before - first, count)
    sampled_open = np.repeat(columns["is_open"].astype(bool), count)
    unsure = np.full(len(steps), 1 - SURE)
    times_ns = np.concatenate([steps * step_ns, columns["seen_ns"]])
    order = np.argsort(times_ns, kind="stable")
    return Readings(
        (times_ns[order] - zero_ns) / SECOND_NS,
        np.concatenate([sampled_open, columns["reads_open"].astype(bool)])[order],
        np.concatenate([unsure, 1 - columns["accuracy_open"]])[order],
        np.concatenate([unsure, 1 - columns["accuracy_closed"]])[order],
    )
