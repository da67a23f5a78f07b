"""A sensor's two accuracies, from times in which the true state is known.

Queries about beliefs report sensors that are not as accurate as declared; the numbers still use the
declared accuracies. What readings alone suggest may be due to the door: only who knows the true
state can decide, and declares what `calibrate` finds.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.trials import StateIntervals
from semmap_log.analysis.probabilities.beta import beta_interval
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.analysis.probabilities.evidence.visits import visits_of
from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt, sensor_doubts
from semmap_log.core.batches.event_batch import distinct
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved
from semmap_log.core.texts import command_line
from semmap_log.core.users_line import frames_of_ours
from semmap_log.errors import EstimatorError, SensorWarning
from semmap_log.log import DoorLog

Times = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class SensorHits:
    """How often a sensor read correctly; a pass counts by the share of its sightings that did."""

    right: float = 0.0
    visits: int = 0
    sightings: int = 0

    def __add__(self, other: SensorHits) -> SensorHits:
        """Return both together."""
        return SensorHits(
            self.right + other.right, self.visits + other.visits, self.sightings + other.sightings
        )

    @property
    def accuracy(self) -> float | None:
        """Share of the visits that read correctly; None: there was none."""
        return self.right / self.visits if self.visits else None

    @property
    def declared(self) -> float | None:
        """What to declare as the sensor's accuracy: the mean of that distribution, at least 0.5.

        It is never 1: some visits without a mistake do not prove that there are none.
        """
        if not self.visits:
            return None
        return max(0.5, (self.right + 0.5) / (self.visits + 1))

    @property
    def interval(self) -> tuple[float, float]:
        """The 90 % interval of the accuracy: of a Beta distribution with Jeffreys' prior."""
        return beta_interval(self.right + 0.5, self.visits - self.right + 0.5)


@dataclass(frozen=True, slots=True)
class DoorCalibration:
    """How a sensor read a door while its state was known."""

    when_open: SensorHits = SensorHits()
    when_closed: SensorHits = SensorHits()

    def __add__(self, other: DoorCalibration) -> DoorCalibration:
        """Return both together."""
        return DoorCalibration(
            self.when_open + other.when_open, self.when_closed + other.when_closed
        )


@dataclass(frozen=True, slots=True)
class Calibration:
    """How a sensor read while states were known."""

    doors: Mapping[DoorId, DoorCalibration]
    """Those that were seen in that time."""
    unseen: Collection[DoorId] = field(default=())
    """Doors of known truth without a sighting in it."""

    @property
    def together(self) -> DoorCalibration:
        """All doors as one."""
        return sum(self.doors.values(), DoorCalibration())


def calibrate(
    log: DoorLog, truths: Mapping[DoorId, StateIntervals], *, source: str | None = None
) -> Calibration:
    """Return how sightings in a log agree with the known truth.

    Sightings that repeat in one pass count as one visit, as they do as evidence; a pass is cut
    where the true state changes.

    Args:
        log: The log of the sightings.
        truths: When each door was known to be open or closed.
        source: Only sightings whose commit names this source; default: all.

    Raises:
        EstimatorError: No sighting lies in the known time.
    """
    seen = _sightings(log, list(truths), source)
    doors = {d: _calibrated(*seen[d], truths[d]) for d in seen}
    found = {
        door_id: one
        for door_id, one in doors.items()
        if one.when_open.visits or one.when_closed.visits
    }
    if not found:
        of = "" if source is None else f" of source {source!r}"
        raise EstimatorError(
            f"{log.path}: nothing to calibrate: expected sightings{of} of a door while its true "
            "state is known, got none; look at `timeline` and at the zone of the truth's times."
        )
    return Calibration(found, [door_id for door_id in truths if door_id not in found])


def _sightings(
    log: DoorLog, door_ids: Collection[DoorId], source: str | None
) -> dict[DoorId, tuple[Times, NDArray[np.bool_], NDArray[np.uint32]]]:
    """Return (when, what it read, which sensor) of the sightings of each door, in order."""
    numbers = None if source is None else _numbers_from(log, source)
    parts: dict[DoorId, list[tuple[Times, NDArray[np.void]]]] = {}
    for batch in log.batches(kinds=[DoorObserved], doors=door_ids):
        chosen = batch if numbers is None else batch.select(np.isin(batch.number, numbers))
        if DoorObserved not in chosen:
            continue
        rows, times_ns = chosen[DoorObserved], chosen.folds_ns[chosen.where(DoorObserved)]
        for door_id in distinct(rows["door_id"]).tolist():
            own = rows["door_id"] == door_id
            parts.setdefault(DoorId(door_id), []).append((times_ns[own], rows[own]))
    return {door_id: _in_order(parts[door_id]) for door_id in door_ids if door_id in parts}


def _in_order(
    parts: list[tuple[Times, NDArray[np.void]]],
) -> tuple[Times, NDArray[np.bool_], NDArray[np.uint32]]:
    times_ns, rows = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(times_ns, kind="stable")
    times_ns, rows = times_ns[order], rows[order]
    tells = np.isin(rows["state"], (DoorState.OPEN, DoorState.CLOSED))
    pair = rows["accuracy_open"] + 1j * rows["accuracy_closed"]
    sensor = np.unique(pair, return_inverse=True)[1].astype(np.uint32)
    return times_ns[tells], rows["state"][tells] == DoorState.OPEN, sensor[tells]


def _numbers_from(log: DoorLog, source: str) -> NDArray[np.int64]:
    """Return the numbers of the events whose commit names a source."""
    spans = [
        np.arange(commit.first_event, commit.last_event + 1)
        for commit in log.commits()
        if commit.note.source == source
    ]
    return np.concatenate([np.empty(0, np.int64), *spans])


def _calibrated(
    times_ns: Times,
    reads_open: NDArray[np.bool_],
    sensor: NDArray[np.uint32],
    truth: StateIntervals,
) -> DoorCalibration:
    known = truth.known_at(times_ns)
    stretch = np.searchsorted(truth.start_ns, times_ns[known], "right") - 1
    visit = visits_of(times_ns[known], sensor[known], stretch, np.zeros(len(stretch))).visit
    is_open = truth.is_open[stretch]
    return DoorCalibration(
        _hits(visit[is_open], reads_open[known][is_open]),
        _hits(visit[~is_open], ~reads_open[known][~is_open]),
    )


def _hits(visit: NDArray[np.intp], is_right: NDArray[np.bool_]) -> SensorHits:
    if not len(visit):
        return SensorHits()
    count = np.bincount(visit)
    right = np.bincount(visit, is_right)
    return SensorHits(
        float((right[count > 0] / count[count > 0]).sum()),
        int(np.count_nonzero(count)),
        len(visit),
    )


def truths_of_rows(
    rows: Mapping[str, tuple[Times, NDArray[np.uint8]]], resolve: Mapping[str, DoorId]
) -> dict[DoorId, StateIntervals]:
    """Return when doors are known, from rows (times, states) of each door's name, in order.

    A row holds until the next one; the last one of a door ends what is known of it.
    """
    found = {}
    for name, (times_ns, states) in rows.items():
        start_ns, end_ns, state = times_ns[:-1], times_ns[1:], states[:-1]
        tells = np.isin(state, (DoorState.OPEN, DoorState.CLOSED)) & (end_ns > start_ns)
        found[resolve[name]] = StateIntervals(
            start_ns[tells], end_ns[tells], state[tells] == DoorState.OPEN
        )
    return found


def warn_of_sensors(
    log: DoorLog, evidence: Evidence, door_ids: Iterable[DoorId], until_ns: int
) -> list[SensorDoubt]:
    """Return the sensors whose readings contradict their declaration, and warn of each.

    Args:
        log: The log of the evidence.
        evidence: The evidence.
        door_ids: The queried doors.
        until_ns: What comes after does not count.
    """
    found = sensor_doubts(evidence, door_ids, until_ns)
    labels = log.door_labels() if found else {}
    named = [replace(doubt, door=labels.get(doubt.door_id, "")) for doubt in found]
    for doubt in named:
        how = command_line("calibrate", log.path, "--truth", "FILE.csv")
        source = f" --source {doubt.sensor.source}" if doubt.sensor.source else ""
        warnings.warn(
            f"{doubt}; with times at which the true state is known, find what to declare: "
            f"{how}{source}",
            SensorWarning,
            stacklevel=frames_of_ours(),
        )
    return named
