"""What events say about how doors are: stretches in which a state is known, and sightings.

It decides how long a state that was set is known to hold, and which sightings stand by themselves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.visits import (
    MOST_ACCURACY,
    Reports,
    Rows,
    Sensor,
    Sensors,
    llr_of,
    visits_of,
)
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import are_sightings, of_presence
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.meaning import Presence
from semmap_log.core.model.moments import DAY_NS

Times = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class DoorEvidence:
    """What is known of a door up to `until_ns`, that moment included."""

    door_id: DoorId
    until_ns: int
    start_ns: Times
    """(m,), ascending: when stretches begin in which the state is known throughout."""
    end_ns: Times
    """(m,): when they end; <= the next one's start, and <= `until_ns`. Two that touch are in
    different states, unless a sighting that disagreed lies between them; only one that begins at
    `until_ns` has no length."""
    is_open: NDArray[np.bool_]
    """(m,): their state."""
    seen_ns: Times
    """(k,), ascending: sightings, outside of the stretches or at their edges."""
    llr: NDArray[np.float64]
    """(k,): what each adds to log P(what was read | open) / P(... | closed), in nats: a visit's
    sightings sum up to their mean, so that a hundred in one pass are as good as one."""
    accuracy_open: NDArray[np.float64]
    """(k,): P(reads open | open) of the sensor."""
    accuracy_closed: NDArray[np.float64]
    """(k,): P(reads closed | closed)."""
    reads_open: NDArray[np.bool_]
    """(k,): what it read."""
    is_visit: NDArray[np.bool_]
    """(k,): the first sighting of a pass; the others of it add no visit."""
    visit: NDArray[np.intp]
    """(k,): which visit each sighting belongs to, counted from 0 as they begin. Those of different
    sensors may mix."""
    holds_on: bool = False
    """The last stretch holds at `until_ns`, too: it ends there only because the evidence does."""

    @classmethod
    def nothing(cls, door_id: DoorId, until_ns: int) -> DoorEvidence:
        """Return the evidence about a door without any report."""
        return _evidence_of(door_id, Reports().about(door_id), Reports().sensors()).up_to(until_ns)

    @property
    def is_empty(self) -> bool:
        """Nothing is known of the door."""
        return not (len(self.start_ns) or len(self.seen_ns))

    @property
    def first_ns(self) -> int:
        """When the first of it begins; `until_ns` where there is none."""
        firsts = [int(times[0]) for times in (self.start_ns, self.seen_ns) if len(times)]
        return min(firsts, default=self.until_ns)

    def up_to(self, until_ns: int) -> DoorEvidence:
        """Return what was known at an earlier time, as without the events after it."""
        held = slice(int(np.searchsorted(self.start_ns, until_ns, "right")))
        last = self.end_ns[held][-1:]
        holds_on = bool((last > until_ns).any()) or (self.holds_on and until_ns >= self.until_ns)
        seen = slice(int(np.searchsorted(self.seen_ns, until_ns, "right")))
        return replace(
            self,
            until_ns=min(until_ns, self.until_ns),
            start_ns=self.start_ns[held],
            end_ns=np.minimum(self.end_ns[held], until_ns),
            is_open=self.is_open[held],
            holds_on=holds_on,
            **{name: getattr(self, name)[seen] for name in _OF_SIGHTINGS},
        )


_OF_SIGHTINGS = (
    "seen_ns", "llr", "accuracy_open", "accuracy_closed", "reads_open", "is_visit", "visit",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Counts:
    """The number of reports about a door."""

    words: int
    """Events that report its state: that it was set, seen, or passed."""
    sightings: int
    """Of these, those that saw it open or closed."""
    visits: int
    """Passes in which it was seen while its state was not known."""
    last_seen_ns: int | None
    """When it was last reported open or closed; None: never."""


class Evidence:
    """What is known of all doors of a log: a fold of its events, in any order."""

    def __init__(self, reports: Reports | None = None, latest_ns: int = 0) -> None:
        self._reports = reports or Reports()
        self.latest_ns = latest_ns
        """The latest time of all events, whatever they are about."""
        self._known: dict[DoorId, _Known] = {}
        """Of the doors requested so far, the evidence from the first `_count` reports."""
        self._count = 0

    def __len__(self) -> int:
        """Return how many reports there are."""
        return len(self._reports)

    def apply(self, batch: EventBatch) -> None:
        """Fold a batch in."""
        if len(batch):
            self.latest_ns = max(self.latest_ns, int(batch.folds_ns.max()))
            self._reports.take(batch)

    def add(self, other: Evidence) -> None:
        """Add the evidence of other events, none of which is among those here."""
        self.latest_ns = max(self.latest_ns, other.latest_ns)
        self._reports.add(other._reports)

    @property
    def door_ids(self) -> list[DoorId]:
        """Doors with any report, removed ones included, ascending."""
        return [DoorId(door_id) for door_id in self._reports.door_ids().tolist()]

    def door(self, door_id: DoorId, until_ns: int | None = None) -> DoorEvidence:
        """Return what is known of a door; without any report, nothing.

        Args:
            door_id: Any.
            until_ns: What comes after does not count; default: the latest event's time. A state
                that was set last goes on to hold beyond that.
        """
        return self._about(door_id).evidence.up_to(_or(until_ns, self.latest_ns))

    def as_last_reported(self, door_id: DoorId, until_ns: int) -> DoorEvidence:
        """Return what was known of a door at its last report, no later than `until_ns`.

        It stays the same until the next report about this door, however long that takes.
        """
        known = self._about(door_id)
        count = int(np.searchsorted(known.reports["folds_ns"], until_ns, "right"))
        last_ns = int(known.reports["folds_ns"][count - 1]) if count else until_ns
        return known.evidence.up_to(last_ns)

    def up_to(self, until_ns: int | None = None) -> Mapping[DoorId, DoorEvidence]:
        """Return what is known of each of `door_ids`, computed on request."""
        return _EvidenceOfDoors(self, _or(until_ns, self.latest_ns))

    def counts(self, door_id: DoorId, until_ns: int | None = None) -> Counts:
        """Return the number of reports about a door up to then."""
        until_ns = _or(until_ns, self.latest_ns)
        known = self._about(door_id)
        reports = known.reports[: np.searchsorted(known.reports["folds_ns"], until_ns, "right")]
        tells = reports[np.isin(reports["state"], (DoorState.OPEN, DoorState.CLOSED))]
        return Counts(
            words=int(np.count_nonzero(~of_presence(reports, Presence.GOES))),
            sightings=int(np.count_nonzero(are_sightings(tells))),
            visits=int(np.count_nonzero(known.evidence.up_to(until_ns).is_visit)),
            last_seen_ns=int(tells["folds_ns"][-1]) if len(tells) else None,
        )

    def readings(
        self, door_ids: Iterable[DoorId], until_ns: int, *, most: int
    ) -> tuple[Rows, list[Sensor]]:
        """Return each reading of some doors, and the sensors by their indices.

        Args:
            door_ids: The doors.
            until_ns: What comes after does not count.
            most: Only so many: the latest.

        Returns:
            Sightings that say open or closed, by door, then in order, as `reports.REPORT`.
        """
        rows = self._reports.latest(np.array(list(door_ids), np.uint32), until_ns, most)
        tells = np.isin(rows["state"], (DoorState.OPEN, DoorState.CLOSED)) & are_sightings(rows)
        return rows[tells], self._reports.known_sensors()

    def dump(self) -> bytes:
        """Return it as bytes."""
        return self.latest_ns.to_bytes(8, "little") + self._reports.dump()

    @classmethod
    def load(cls, data: bytes) -> Evidence:
        """Return the evidence in the bytes of `dump`.

        Raises:
            ValueError: They are not from `dump`.
        """
        return cls(Reports.load(data[8:]), int.from_bytes(data[:8], "little"))

    def _about(self, door_id: DoorId) -> _Known:
        """Return all that is known of a door; new reports cause it to be computed again."""
        if self._count < len(self._reports):
            for changed in self._reports.newer(self._count).tolist():
                self._known.pop(DoorId(changed), None)
            self._count = len(self._reports)
        known = self._known.get(door_id)
        if known is None:
            reports = _while_there(self._reports.about(door_id))
            evidence = _evidence_of(door_id, reports, self._reports.sensors())
            known = self._known[door_id] = _Known(reports, evidence)
        return known


class EvidenceProjection:
    """`Evidence` as a fold over a log: `log.fold(EvidenceProjection())`, also live, or in parts."""

    name = "evidence"
    version = 2

    def initial(self) -> Evidence:
        """Return no evidence."""
        return Evidence()

    def apply(self, state: Evidence, batch: EventBatch, /) -> Evidence:
        """Fold a batch in."""
        state.apply(batch)
        return state

    def merge(self, earlier: Evidence, later: Evidence, /) -> Evidence:
        """Return the evidence of both parts of a log."""
        earlier.add(later)
        return earlier

    def dump(self, state: Evidence, /) -> bytes:
        """Return the evidence as bytes."""
        return state.dump()

    def load(self, data: bytes, /) -> Evidence:
        """Return the evidence in the bytes of `dump`."""
        return Evidence.load(data)


@dataclass(frozen=True, slots=True)
class _Known:
    reports: Rows
    evidence: DoorEvidence
    """Of all reports; its stretches end where these let them."""


class _EvidenceOfDoors(Mapping[DoorId, DoorEvidence]):
    """Door -> what is known of it up to a time."""

    def __init__(self, evidence: Evidence, until_ns: int) -> None:
        self._evidence = evidence
        self._until_ns = until_ns
        self._ids = dict.fromkeys(evidence.door_ids)

    def __getitem__(self, door_id: DoorId) -> DoorEvidence:
        if door_id not in self._ids:
            raise KeyError(door_id)
        return self._evidence.door(door_id, self._until_ns)

    def __iter__(self) -> Iterator[DoorId]:
        return iter(self._ids)

    def __len__(self) -> int:
        return len(self._ids)


def _while_there(reports: Rows) -> Rows:
    """Return the reports from a door's addition to its removal; others are about no door."""
    added = np.flatnonzero(of_presence(reports, Presence.COMES))
    reports = reports[added[0] :] if len(added) else reports[:0]
    removed = np.flatnonzero(of_presence(reports, Presence.GOES))
    return reports[: removed[0] + 1] if len(removed) else reports


def _evidence_of(door_id: DoorId, reports: Rows, sensors: Sensors) -> DoorEvidence:
    """Return the meaning of the reports about a door."""
    known = known_intervals(reports)
    seen_ns, state, code = (reports[name][known.points] for name in ("folds_ns", "state", "sensor"))
    accuracy_open, accuracy_closed, sensor = (column[code] for column in sensors)
    reads_open = state == DoorState.OPEN
    # A certain sighting stands by itself: no pass goes on over it, nor with it.
    certain = np.cumsum((accuracy_open >= MOST_ACCURACY) & (accuracy_closed >= MOST_ACCURACY))
    visits = visits_of(
        seen_ns,
        sensor,
        known.segment + certain,
        llr_of(reads_open, accuracy_open, accuracy_closed),
    )
    is_visit = np.ones(len(seen_ns), np.bool_)
    is_visit[1:] = visits.visit[1:] > np.maximum.accumulate(visits.visit)[:-1]
    return DoorEvidence(
        door_id,
        until_ns=MAX_TIME_NS,
        start_ns=known.start_ns,
        end_ns=known.end_ns,
        is_open=known.is_open,
        seen_ns=seen_ns,
        llr=visits.llr,
        accuracy_open=accuracy_open,
        accuracy_closed=accuracy_closed,
        reads_open=reads_open,
        is_visit=is_visit,
        visit=visits.visit,
    )


def _or(given: int | None, default: int) -> int:
    return default if given is None else given


HOLDS_NS = 30 * DAY_NS
"""How long after the last report that agreed a set state is known; a longer silence is a gap,
and not "as before"."""


class KnownIntervals(NamedTuple):
    """The meaning of the reports about a door."""

    start_ns: NDArray[np.int64]
    """(m,), ascending: when stretches begin in which the state is known. Two that touch are in
    different states, unless a sighting that disagreed lies between them."""
    end_ns: NDArray[np.int64]
    """(m,), > start: when they end, as far as these reports show."""
    is_open: NDArray[np.bool_]
    """(m,)."""
    points: NDArray[np.intp]
    """(k,), ascending: which reports are sightings, OPEN or CLOSED, of no held state."""
    segment: NDArray[np.intp]
    """(k,), never falling: two points of different ones have a report between them that is no
    sighting of a state: a pass does not go on over it."""


def known_intervals(reports: Rows) -> KnownIntervals:
    """Return the meaning of reports about one door that exists throughout.

    A state that was set is known from then on: until the next report that is not a sighting, until
    a sighting that disagrees, or `HOLDS_NS` after the last report that agreed. The state of
    `DoorAdded` is only an assumption of the map's author: any sighting replaces it. UNKNOWN,
    MOVING and OFFLINE, set or seen, and the removal end it, and nothing is known.

    Args:
        reports: In the order of the fold.
    """
    folds_ns, state = reports["folds_ns"], reports["state"]
    was_seen = are_sightings(reports)
    tells = (state == DoorState.OPEN) | (state == DoorState.CLOSED)
    is_sighting = was_seen & tells
    base = _last_true(~is_sighting)
    holds = tells[base] & ~was_seen[base]
    disagrees = (state != state[base]) | of_presence(reports, Presence.COMES)[base]
    lapsed = np.diff(folds_ns, prepend=folds_ns[:1]) > HOLDS_NS
    broken = np.cumsum(is_sighting & (disagrees | lapsed))
    agrees = holds & (broken == broken[base])
    is_point = is_sighting & ~agrees
    points = np.flatnonzero(is_point)
    stretches = _stretches(reports, base, agrees, np.cumsum(is_point))
    return KnownIntervals(*stretches, points, base[points])


def _last_true(flags: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return for each place the last one up to it that is true; the first is."""
    return np.maximum.accumulate(np.where(flags, np.arange(len(flags)), 0))


def _stretches(
    reports: Rows,
    base: NDArray[np.intp],
    agrees: NDArray[np.bool_],
    points_so_far: NDArray[np.intp],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return (start, end, is_open) of the stretches; touching ones of one state are joined."""
    folds_ns = reports["folds_ns"]
    last = _last_of_each(base, agrees)
    silent_ns = np.minimum(folds_ns[last], MAX_TIME_NS - HOLDS_NS) + HOLDS_NS
    end_ns = np.minimum(silent_ns, np.append(folds_ns[1:], MAX_TIME_NS)[last])
    has_length = end_ns > folds_ns[base[last]]
    last, end_ns = last[has_length], end_ns[has_length]
    first = base[last]
    start_ns, is_open = folds_ns[first], reports["state"][first] == DoorState.OPEN
    goes_on = (
        (start_ns[1:] == end_ns[:-1])
        & (is_open[1:] == is_open[:-1])
        & (points_so_far[first[1:]] == points_so_far[last[:-1]])
    )
    begins, ends = np.ones((2, len(first)), np.bool_)
    begins[1:], ends[:-1] = ~goes_on, ~goes_on
    return start_ns[begins], end_ns[ends], is_open[begins]


def _last_of_each(base: NDArray[np.intp], agrees: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the last report that agrees with each state that was set."""
    agreeing = np.flatnonzero(agrees)
    is_last = np.ones(len(agreeing), np.bool_)
    is_last[:-1] = base[agreeing[1:]] != base[agreeing[:-1]]
    return agreeing[is_last]
