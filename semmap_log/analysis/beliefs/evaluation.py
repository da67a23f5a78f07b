"""How good an estimator's forecasts of a log's doors are, by a protocol that others use, too.

The protocol is that of the published door benchmarks (Krajník et al., RA-L 2019, arXiv 1810.04285):
samples a minute apart within the known time, the first part teaches, the last is forecast.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from semmap_log.analysis.beliefs.protocol import Patrol, Protocol, visited
from semmap_log.analysis.beliefs.sensor_calibration import warn_of_sensors
from semmap_log.analysis.beliefs.trials import (
    StateIntervals,
    Trials,
    holds_truth,
    reading_trials,
    truth_trials,
    truths,
    whole_ns,
)
from semmap_log.analysis.probabilities.estimator import Estimator, LearntModel, Times
from semmap_log.analysis.probabilities.evidence.evidence import Evidence, EvidenceProjection
from semmap_log.analysis.probabilities.scores import (
    Probabilities,
    Reliability,
    Scores,
    mean_scores,
    scores,
)
from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import Time
from semmap_log.errors import EstimatorError
from semmap_log.log import DoorLog, believable_span, warn_of_clock

LEAST_SAMPLES = (200, 100)
"""A door with fewer samples to learn from, or to be forecast, is left out."""
LEAST_VISITS = (20, 10)
"""The same where visits are forecast."""
MOST_SAMPLES = 2**21
"""Of a door: four years of minutes. Where more is known, forecasts lie farther apart."""
AT_ONCE = 2**16

ForecastReader = Callable[[str, str, Trials, Probabilities], None]
"""Takes the names of a protocol and an estimator, the trials of one door, and P(outcome 1) of
each."""


@dataclass(frozen=True, slots=True)
class DoorEvaluation:
    """How good the forecasts of one door were."""

    door_id: DoorId
    training: int
    """Samples, or visits, before the split."""
    tests: int
    """Those after it: forecasts of each estimator."""
    scores: Mapping[str, Scores]
    """Estimator -> its figures."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """How good the forecasts of all doors were."""

    protocol: Protocol
    is_truth: bool
    """True: compared with a state that was known throughout; False: with the sensor's next
    reading."""
    doors: Sequence[DoorEvaluation]
    left_out: Mapping[DoorId, str]
    """Doors with too little known time, and how much they have."""
    reliability: Mapping[str, Reliability]
    """Estimator -> outcomes by forecast probability, all doors together."""
    sensor_doubts: Sequence[SensorDoubt] = ()
    """Sensors that are not as accurate as declared: forecasts, and what they are compared with, are
    off alike."""

    @property
    def mean(self) -> Mapping[str, Scores]:
        """Estimator -> mean over the doors, each weighing the same."""
        return {
            name: mean_scores([door.scores[name] for door in self.doors])
            for name in self.reliability
        }


def evaluate(
    log: DoorLog,
    estimators: Sequence[Estimator],
    protocol: Protocol = Protocol(),
    *,
    doors: Collection[DoorId] | None = None,
    since: Time = None,
    until: Time = None,
    tz: str | None = None,
    progress: Progress | None = None,
) -> Evaluation:
    """Return how good the estimators' forecasts of a log's doors are.

    If the log mostly knows states throughout, they are the truth. If it mostly contains visits,
    there is no truth, and each visit's reading is forecast from the evidence before it.

    Args:
        log: Where the doors are from.
        estimators: Methods, of different names.
        protocol: What is known at each forecast.
        doors: Only these; default: all with evidence.
        since: Only the known time from then on; earlier evidence still counts for training.
        until: Only the known time before then.
        tz: IANA zone of the building's clocks; default: the log's.
        progress: Called with (done, in all); the unit is the forecasts of a door by an estimator.

    Raises:
        EstimatorError: No door has enough known time, or visits; a patrol of a log without truth.
    """
    return evaluate_all(
        log, estimators, {"": protocol}, doors=doors, since=since, until=until, tz=tz,
        progress=progress,
    )[""]  # fmt: skip


def evaluate_all(
    log: DoorLog,
    estimators: Sequence[Estimator],
    protocols: Mapping[str, Protocol],
    *,
    doors: Collection[DoorId] | None = None,
    since: Time = None,
    until: Time = None,
    tz: str | None = None,
    progress: Progress | None = None,
    read_forecasts: ForecastReader | None = None,
) -> dict[str, Evaluation]:
    """Return evaluations by several protocols, as `evaluate`, but learn only once for all.

    Args:
        log: The log; see `evaluate` for all arguments.
        estimators: Methods.
        protocols: By names.
        doors: Only these.
        since: From then on.
        until: Before then.
        tz: The zone of the clocks.
        progress: Called with the progress.
        read_forecasts: Called with the forecasts themselves, once a door, estimator and protocol;
            an evaluation contains their figures only.
    """
    warn_of_clock(log)
    evidence = log.fold(EvidenceProjection())
    chosen = [d for d in evidence.door_ids if doors is None or d in doors]
    asked = log.instant(since), log.instant(until)
    span = [b if a is None else a for a, b in zip(asked, believable_span(log), strict=True)]
    clock = LocalClock(log.info.timezone if tz is None else tz)
    is_truth = holds_truth(evidence, chosen)
    stretches = (
        {d: found.between(*span) for d, found in truths(log, evidence, chosen)} if is_truth else {}
    )
    if not is_truth and any(protocol.patrol for protocol in protocols.values()):
        raise EstimatorError(
            f"{log.path}: a patrol visits doors whose states are known, and this log holds mostly "
            "sightings; evaluate it without a patrol."
        )

    def ask(door_id: DoorId, protocol: Protocol) -> Trials:
        if is_truth:
            return truth_trials(door_id, stretches[door_id], whole_ns(protocol.step_s))
        return reading_trials(evidence.door(door_id), *span)

    tests = {
        name: _Test(name, _coarse(of, stretches), is_truth, clock, stretches, ask, read_forecasts)
        for name, of in protocols.items()
    }
    for test in tests.values():
        test.take(chosen, str(log.path))
    _run(tests, estimators, evidence=evidence, stretches=stretches, clock=clock, progress=progress)
    doubts = warn_of_sensors(log, evidence, chosen, evidence.latest_ns)
    return {name: replace(test.evaluation(), sensor_doubts=doubts) for name, test in tests.items()}


def _coarse(protocol: Protocol, stretches: Mapping[DoorId, StateIntervals]) -> Protocol:
    """Return the protocol with steps so long that no door has more than `MOST_SAMPLES`."""
    step_ns = whole_ns(protocol.step_s)
    most = max((found.count(step_ns) for found in stretches.values()), default=0)
    times = -(-most // MOST_SAMPLES)
    return protocol if times <= 1 else replace(protocol, step_s=protocol.step_s * times)


def _run(
    tests: Mapping[str, _Test],
    estimators: Sequence[Estimator],
    *,
    evidence: Evidence,
    stretches: Mapping[DoorId, StateIntervals],
    clock: LocalClock,
    progress: Progress | None,
) -> None:
    """Let each estimator learn from each source, and make all forecasts based on it."""
    done, total = 0, len(estimators) * sum(len(test.doors) for test in tests.values())
    for patrol in {test.protocol.patrol: None for test in tests.values()}:
        known = _source(patrol, evidence, tests, stretches)
        same = [test for test in tests.values() if test.protocol.patrol == patrol]
        for estimator in estimators:
            learnt = estimator.learn(known.up_to(), clock)
            for door_id in dict.fromkeys(door_id for test in same for door_id in test.doors):
                for test in same:  # door by door: what was learnt of one may be kept for so long
                    if door_id in test.doors:
                        test.forecast(door_id, estimator.name, learnt)
                        done += 1
                if progress is not None:
                    progress(done, total)


def _source(
    patrol: Patrol | None,
    evidence: Evidence,
    tests: Mapping[str, _Test],
    stretches: Mapping[DoorId, StateIntervals],
) -> Evidence:
    if patrol is None:
        return evidence
    asked = {d for test in tests.values() if test.protocol.patrol == patrol for d in test.doors}
    return visited({d: found for d, found in stretches.items() if d in asked}, patrol)


@dataclass
class _Test:
    """The state of a protocol while its forecasts are made."""

    name: str
    protocol: Protocol
    is_truth: bool
    clock: LocalClock
    stretches: Mapping[DoorId, StateIntervals]
    """Of a truth: when each door is known."""
    ask: Callable[[DoorId, Protocol], Trials]
    """Returns the trials of a door, made each time: kept for all doors they would fill memory."""
    read_forecasts: ForecastReader | None
    doors: dict[DoorId, tuple[int, int]] = field(default_factory=dict)
    """How many samples are for training, and when the first one after them is."""
    left_out: dict[DoorId, str] = field(default_factory=dict)
    scores: dict[DoorId, dict[str, Scores]] = field(default_factory=dict)
    reliability: dict[str, Reliability] = field(default_factory=dict)

    def take(self, door_ids: Sequence[DoorId], where: str) -> None:
        """Split each door's trials into training and test; leave out doors with too few.

        Raises:
            EstimatorError: No door is left.
        """
        least = LEAST_SAMPLES if self.is_truth else LEAST_VISITS
        for door_id in door_ids:
            trials = self.ask(door_id, self.protocol)
            training = int(self.protocol.split * len(trials))
            tests = len(trials) - training
            if training < least[0] or tests < least[1]:
                self.left_out[door_id] = f"{training} to learn from, {tests} to forecast"
                continue
            self.doors[door_id] = training, int(trials.times_ns[training])
        if not self.doors:
            unit = "samples of a known state" if self.is_truth else "visits"
            raise EstimatorError(
                f"{where}: nothing to evaluate: expected a door with at least {least[0]} {unit} "
                f"to learn from and {least[1]} to forecast; doors with fewer: {len(self.left_out)}."
            )

    def forecast(self, door_id: DoorId, name: str, learnt: LearntModel) -> None:
        """Make the forecasts of a door, and score them."""
        training, split_ns = self.doors[door_id]
        trials = self._tests(door_id, training)
        known_ns = self.protocol.known_ns(trials, split_ns, self.clock)
        p = trials.p_outcome(_p_open(door_id, learnt, trials.times_ns, known_ns))
        self.scores.setdefault(door_id, {})[name] = scores(p, trials.outcome)
        found = Reliability.of(p, trials.outcome)
        before = self.reliability.get(name)
        self.reliability[name] = found if before is None else before + found
        if self.read_forecasts is not None:
            self.read_forecasts(self.name, name, trials, p)

    def _tests(self, door_id: DoorId, training: int) -> Trials:
        """Return a door's trials after the training part."""
        trials = self.ask(door_id, self.protocol).only(slice(training, None))
        if self.is_truth and self.protocol.needs_known:
            before_ns = trials.times_ns - (self.protocol.horizon_ns or 0)
            return trials.only(self.stretches[door_id].known_at(before_ns))
        return trials

    def evaluation(self) -> Evaluation:
        """Return the evaluation."""
        doors = [
            DoorEvaluation(door_id, training, _count(self.scores[door_id]), self.scores[door_id])
            for door_id, (training, _) in self.doors.items()
        ]
        return Evaluation(self.protocol, self.is_truth, doors, self.left_out, self.reliability)


def _p_open(
    door_id: DoorId, learnt: LearntModel, times_ns: Times, known_ns: Times
) -> Probabilities:
    """Return P(open) at each time; some are forecast at a time, to bound memory."""
    parts = (slice(i, i + AT_ONCE) for i in range(0, max(len(times_ns), 1), AT_ONCE))
    said = (learnt.predict(door_id, times_ns[part], known_ns[part]).p_open for part in parts)
    return np.concatenate([*said])


def _count(each: Mapping[str, Scores]) -> int:
    return max((scores.count for scores in each.values()), default=0)
