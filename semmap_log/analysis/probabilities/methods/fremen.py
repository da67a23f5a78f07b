"""FreMEn: a door's state as a sum of the strongest of 84 periodic components.

Krajník, Fentanes, Cielniak, Dondrup, Duckett: Spectral analysis for long-term robotic mapping (ICRA
2014); Krajník, Fentanes, Santos, Duckett: FreMEn (T-RO 2017). Rules and constants are those of
`CFrelement.cpp` in strands-project/fremen and, for the balance, in gestom/Hypertime-RAL-19-0307.
Kept for comparison.

There a state is added as a sample at a time, and the spectrum is a sum over samples. Here a stretch
of a known state adds its integral in closed form, which is what ever denser samples tend to; so
three years cost as much as their changes of state, not as their minutes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.evidence.samples import SAMPLE_S, KnownTime
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.by_door import LearntByDoor
from semmap_log.core.batches.event_batch import distinct, numbers_of
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import DAY_S, HOUR_S, WEEK_S, LocalClock
from semmap_log.core.model.moments import SECOND_NS

Times = NDArray[np.int64]
Floats = NDArray[np.float64]

PERIODS_S = WEEK_S // np.arange(1, WEEK_S // HOUR_S // 2 + 1)
"""(84,), whole seconds: a week, and its parts down to two hours."""
OMEGA = 2 * np.pi / PERIODS_S
"""(84,), radians a second."""
SATURATION = 0.01
"""Forecasts keep so far away from 0 and 1."""
LEARNS_EVERY_NS = HOUR_S * SECOND_NS
"""A model is as of the last full hour before the end of the evidence."""
MOST_HOURS = 100_000
"""Eleven years: of doors of which something was learnt in more hours only the models that are used
for are made."""
CHUNK = 65_536
"""Forecasts made at a time, to bound memory."""


@dataclass(frozen=True, slots=True)
class Fremen:
    """FreMEn with the `order` strongest components."""

    order: int = 5
    """1..84."""

    def __post_init__(self) -> None:
        """Check the order.

        Raises:
            ValueError: There are not so many components.
        """
        if not 1 <= self.order <= len(PERIODS_S):
            raise ValueError(f"FreMEn's order: expected 1..{len(PERIODS_S)}, got {self.order}")

    @property
    def name(self) -> str:
        """`fremen5`."""
        return f"fremen{self.order}"

    def learn(
        self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock
    ) -> LearntByDoor[DoorFremen]:
        """Return the doors' models; a model is made when a forecast asks for it."""
        return LearntByDoor(evidence, lambda door: DoorFremen(door, clock, self.order))


class DoorFremen:
    """The models of one door as they were at any full hour."""

    def __init__(self, evidence: DoorEvidence, clock: LocalClock, order: int) -> None:
        self._known = KnownTime.of(evidence)
        self._clock = clock
        self._order = order
        self._changes = _changes(self._known)
        self._hourly: Models | None = None

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return the sum of the components at each time, by what was known at `known_ns`."""
        models, which = self._models(known_ns // LEARNS_EVERY_NS)
        p = np.empty(len(times_ns))
        for start in range(0, len(p), CHUNK):
            part = slice(start, start + CHUNK)
            p[part] = models.forecast(self._clock.wall_s(times_ns[part]), which[part])
        known_s = models.known_s[which]
        return Forecast.of_share(p, known_s / DAY_S, known_s > 0)

    def _models(self, hours: Times) -> tuple[Models, NDArray[np.intp]]:
        """Return models, and which of them belongs to each hour of knowledge, (n,)."""
        place = np.maximum(np.searchsorted(self._changes, hours, "right") - 1, 0)
        if self._hourly is None:
            asked, which = np.unique(place, return_inverse=True)
            if len(asked) == 1 or len(self._changes) > MOST_HOURS:
                return self._models_of(self._changes[asked]), which
            self._hourly = self._models_of(self._changes)
        return self._hourly, place

    def _models_of(self, hours: Times) -> Models:
        return models_at(self._known, self._clock, hours * LEARNS_EVERY_NS, self._order)


@dataclass(frozen=True, slots=True)
class Models:
    """Models of one door at several times of knowledge, strongest component first."""

    gain: Floats
    """(u,), the mean state."""
    known_s: Floats
    """(u,), how long the state was known."""
    omega: Floats
    """(u, order), radians a second of wall clock."""
    amplitude: Floats
    """(u, order)."""
    phase: Floats
    """(u, order), radians."""

    def forecast(self, wall_s: Floats, which: NDArray[np.intp]) -> Floats:
        """Return P(open) at times of the wall clock, each by one of the models."""
        angle = self.omega[which] * wall_s[:, None] - self.phase[which]
        p: Floats = self.gain[which] + 2 * (self.amplitude[which] * np.cos(angle)).sum(axis=1)
        np.clip(p, SATURATION, 1 - SATURATION, out=p)
        return p


def models_at(known: KnownTime, clock: LocalClock, at_ns: Times, order: int) -> Models:
    """Return the models of the evidence at some times.

    Args:
        known: Of a door.
        clock: Components are of what the building's clocks show.
        at_ns: (u,), each model's time of knowledge.
        order: How many components are kept.
    """
    sums = _Sums(known, clock, at_ns)
    gain = np.divide(sums.open_s, sums.known_s, out=np.zeros(len(at_ns)), where=sums.known_s > 0)
    per_s = 1 / np.maximum(sums.known_s, SAMPLE_S)
    real, imag = np.empty((2, len(at_ns), len(OMEGA)))
    for index, omega in enumerate(OMEGA.tolist()):
        of_states, of_all = sums.spectrum(omega)
        balanced = (of_states - gain * of_all) * per_s
        real[:, index], imag[:, index] = balanced.real, balanced.imag
    amplitude = np.hypot(real, imag)
    strongest = np.argsort(-amplitude, axis=1, kind="stable")[:, :order]
    phase = np.arctan2(imag, real)
    return Models(
        gain,
        sums.known_s,
        OMEGA[strongest],
        np.take_along_axis(amplitude, strongest, axis=1),
        np.take_along_axis(phase, strongest, axis=1),
    )


def _changes(known: KnownTime) -> Times:
    """Return the full hours that know more than the one before, ascending, and one before them.

    At all others, as through a gap of years, the model is that of the last one before.
    """
    first, end = known.start_ns // LEARNS_EVERY_NS, -(-known.end_ns // LEARNS_EVERY_NS)
    seen = known.seen_ns // LEARNS_EVERY_NS
    found = np.concatenate([numbers_of(first, end - first + 1), seen, seen + 1])
    return distinct(found) if len(found) else np.zeros(1, np.int64)


class _Sums:
    """Integrals over the known time of a door, up to several times.

    The wall clock is the axis: of the hour that comes twice, or is skipped, only the difference
    between begin and end of a stretch counts.
    """

    def __init__(self, known: KnownTime, clock: LocalClock, at_ns: Times) -> None:
        self._known = known
        self._stretch = np.searchsorted(known.start_ns, at_ns, "right")
        self._visit = np.searchsorted(known.seen_ns, at_ns, "right")
        edges_ns, edge = np.unique(
            np.concatenate([known.start_ns, known.end_ns]), return_inverse=True
        )
        self._edges_s = clock.wall_s(edges_ns)
        self._start, self._end = np.split(edge, 2)
        self._visit_s = clock.wall_s(known.seen_ns)
        if len(known.start_ns):
            last = np.maximum(self._stretch - 1, 0)
            cut_ns = np.clip(at_ns, known.start_ns[last], known.end_ns[last])
            self._last, self._cut_s = last, clock.wall_s(cut_ns)
        self.open_s, self.known_s = known.until(at_ns)

    def spectrum(self, omega: float) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the integral of exp(i omega t), (u,): where the door was open, and everywhere."""
        at_edges = _turned(omega * self._edges_s)
        at_starts = at_edges[self._start]
        each = (at_edges[self._end] - at_starts) / (1j * omega)
        visits = SAMPLE_S * _turned(omega * self._visit_s)
        of_states = _before(visits * self._known.reads_open)[self._visit]
        of_all = _before(visits)[self._visit]
        if not len(each):
            return of_states, of_all
        # The last stretch counts up to its cut, and is never added whole and cut back: where it
        # ends is later knowledge, which would move the last digit.
        last = (_turned(omega * self._cut_s) - at_starts[self._last]) / (1j * omega)
        last *= self._stretch > 0
        is_open = self._known.is_open
        of_states += _before(each * is_open)[self._last] + last * is_open[self._last]
        of_all += _before(each)[self._last] + last
        return of_states, of_all


def _turned(angle: Floats) -> NDArray[np.complex128]:
    """Return exp(i angle); cosine and sine by themselves are faster."""
    turned = np.empty(len(angle), np.complex128)
    turned.real, turned.imag = np.cos(angle), np.sin(angle)
    return turned


def _before(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the sums of what stands before each place, and of all."""
    return np.concatenate([np.zeros(1, np.complex128), np.cumsum(values)])
