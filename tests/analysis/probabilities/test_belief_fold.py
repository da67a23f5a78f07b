"""An estimator as a fold: replayed, live, in parts, and gone on with at any place, the same."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.analysis.probabilities.belief_fold import ESTIMATORS, BeliefProjection, Beliefs
from semmap_log.analysis.probabilities.estimator import Times
from semmap_log.analysis.probabilities.evidence.day_tables import day_tables
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence, EvidenceProjection
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorRemoved, Retracted
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.telling import DOOR, added, as_batch, ns_of, put, seen
from tests.test_replay import random_log

HOUR = 3600


class Share:
    """P(open) = what was open of all that was known by then, and half an hour of either."""

    name = "share"

    def __init__(self) -> None:
        self.learnings = 0

    def learn(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> ShareLearnt:
        self.learnings += 1
        return ShareLearnt(evidence, clock)


class ShareLearnt:
    def __init__(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> None:
        self.evidence, self.clock = evidence, clock

    def predict(self, door_id: DoorId, times_ns: Times, known_ns: Times) -> Forecast:
        p = np.full(len(times_ns), 0.5)
        is_known = np.zeros(len(times_ns), np.bool_)
        if door_id in self.evidence:
            for i, until_ns in enumerate(known_ns.tolist()):
                found = self.evidence[door_id].up_to(until_ns)
                tables = day_tables(found, self.clock)
                known_h, open_h = tables.known_h.sum(), tables.open_h.sum()
                p[i], is_known[i] = (open_h + 0.5) / (known_h + 1), known_h > 0
        return Forecast.of(p, p, p, is_known)


def shares(beliefs: Beliefs, times: list[int]) -> list[list[float]]:
    asked = np.array(times, np.int64)
    return [beliefs.predict(door, asked).p_open.tolist() for door in beliefs.door_ids]


def some_times(log: sl.DoorLog) -> list[int]:
    end_ns = log.end_ns()
    return [0, end_ns // 2, end_ns, end_ns + 10**12]


def share_of(log: sl.DoorLog, **how: object) -> list[list[float]]:
    beliefs = log.fold(BeliefProjection(Share(), "Europe/Vienna"), **how)
    return shares(beliefs, some_times(log))


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32))
def test_a_fold_that_is_gone_on_with_anywhere_gives_the_same_numbers(seed: int) -> None:
    """From the start, from checkpoints, in merged parts, and live."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        random_log(Path(folder) / "log", dice, commits=25)
        log, saved = sl.read(Path(folder) / "log"), Path(folder) / "saved"
        last = log.replay().event
        projection = BeliefProjection(Share(), "Europe/Vienna")
        cut = dice.randint(0, last)

        whole = share_of(log)
        for event in sorted(dice.choices(range(last + 1), k=3)):
            log.fold(projection, event=event, checkpoint=saved)
        resumed = share_of(log, checkpoint=saved)
        parts = (log.fold_part(projection, 0, cut), log.fold_part(projection, cut + 1, last))
        merged = shares(projection.merge(*parts), some_times(log))
        (*_, live) = log.fold_live(projection, stop=lambda: True)

        assert whole == resumed
        assert whole == merged
        assert whole == shares(live.state, some_times(log))


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32))
def test_evidence_is_what_the_timeline_says_where_no_sensor_is_in_doubt(seed: int) -> None:
    """Two folds of the same words: a stretch is an interval of the timeline, or a part of one."""
    with tempfile.TemporaryDirectory() as folder:
        random_log(Path(folder) / "log", random.Random(seed), commits=25)
        log = sl.read(Path(folder) / "log")

        evidence = log.fold(EvidenceProjection())

        ever = {DoorId(door) for b in log.batches(kinds=[DoorAdded])
                for door in b.door_ids().tolist()}  # fmt: skip
        assert ever <= set(evidence.door_ids)
        for door in sorted(ever):
            found, said = evidence.door(door), log.timeline(door)
            for start, end, is_open in zip(
                found.start_ns, found.end_ns, found.is_open, strict=True
            ):
                over = (said.start_ns < end) & (said.end_ns > start)
                assert set(said.state[over].tolist()) <= {1 if is_open else 2}


@pytest.mark.parametrize("name", sorted(ESTIMATORS))
def test_every_estimator_says_the_same_live_as_in_a_replay(tmp_path: Path, name: str) -> None:
    """Asked after each commit, or read from the start."""
    dice = random.Random(11)
    told = [added()]
    for hour in range(24 * 20):
        if hour % 24 in (8, 9, 12, 15, 20):
            word = dice.choice([seen, seen, seen, put])
            told.append(word(dice.choice(["open", "closed", "closed"]), hour * HOUR))
    projection, ask = BeliefProjection(name, "Europe/Vienna"), np.array([ns_of(24 * 21 * HOUR)])
    live = projection.initial()
    with sl.create(tmp_path / "log", tz="Europe/Vienna", durability="none") as log:
        for start in range(0, len(told), 10):
            log.append(as_batch(told[start : start + 10]))
    log = sl.read(tmp_path / "log")

    for batch in log.batches():
        for part in batch.parts(7):
            live = projection.apply(live, part)
            live.predict(DOOR, ask)
    replayed = log.fold(projection)

    times = np.array([ns_of(hour * HOUR) for hour in range(0, 24 * 22, 5)])
    mine, theirs = live.predict(DOOR, times), replayed.predict(DOOR, times)
    assert mine.p_open.tolist() == theirs.p_open.tolist()
    assert mine.is_known.tolist() == theirs.is_known.tolist()


def test_a_retraction_takes_back_what_had_been_learnt(tmp_path: Path) -> None:
    """The state is folded anew, and is that of a log without the event."""
    projection = BeliefProjection(Share(), "UTC")
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append(as_batch([added(), put("closed", 0), put("open", HOUR)]))
        live = sl.read(tmp_path / "log").fold_live(projection, poll_s=0.001)
        before = next(live)
        times = np.array([ns_of(3 * HOUR)])
        known = before.state.predict(DOOR, times, times).p_open.tolist()

        log.append([Retracted(first_event=2, last_event=2)])
        after = next(live)
        live.close()

    assert [2.5 / 4] == known
    assert after.was_restarted
    assert [0.5 / 4] == after.state.predict(DOOR, times, times).p_open.tolist()


def test_a_late_word_drops_what_was_learnt_without_it() -> None:
    """Nothing is rewound: the word sorts in, and the next question learns anew."""
    estimator = Share()
    projection = BeliefProjection(estimator, "UTC")
    state = projection.apply(projection.initial(), as_batch([added(), put("open", 0)]))
    times = np.array([ns_of(2 * HOUR)])
    before = state.predict(DOOR, times, times).p_open.tolist()
    again = state.predict(DOOR, times, times).p_open.tolist()

    late = sl.EventBatch.from_events([*as_batch([put("closed", HOUR)]).to_events()])
    state = projection.apply(state, late)
    after = state.predict(DOOR, times, times).p_open.tolist()

    assert [2.5 / 3] == before == again
    assert [1.5 / 3] == after
    assert 2 == estimator.learnings


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_what_is_asked_in_between_moves_nothing(seed: int) -> None:
    """Words of three weeks come in parts, some weeks late, and questions are asked in between."""
    rng = random.Random(seed)
    days = sorted(rng.sample(range(24 * 21), 80))
    told = [seen(rng.choice(["open", "closed"]), hour * HOUR) for hour in days]
    late = rng.sample(told, 3)
    parts = [[added()], [t for t in told if t not in late], *([t] for t in late)]
    projection = BeliefProjection("filter", "Europe/Vienna")
    state = projection.initial()

    for i, part in enumerate(parts):
        batch = replace_numbers(as_batch(part), first=1000 * i)
        state = projection.apply(state, batch)
        hours = np.array(sorted(rng.sample(range(24 * 22), 5)))
        times = np.array([ns_of(hour * HOUR) for hour in hours.tolist()])
        found = state.predict(DOOR, times, times)
        anew = Beliefs(state.estimator, state.clock, state.evidence).predict(DOOR, times, times)
        np.testing.assert_allclose(found.p_open, anew.p_open, atol=1e-9)
        np.testing.assert_array_equal(found.is_known, anew.is_known)


def replace_numbers(batch: sl.EventBatch, *, first: int) -> sl.EventBatch:
    """Return the batch with event numbers from `first` on."""
    return replace(batch, number=first + np.arange(len(batch)))


def test_what_is_learnt_up_to_a_time_serves_all_earlier_ones() -> None:
    """To ask further on learns anew, to ask back does not."""
    estimator = Share()
    projection = BeliefProjection(estimator, "UTC")
    state = projection.apply(projection.initial(), as_batch([added(), put("open", 0)]))

    asked = [np.array([ns_of(hours * HOUR)]) for hours in (4, 2, 1, 9)]
    found = [state.predict(DOOR, times, times).p_open[0] for times in asked]

    assert [4.5 / 5, 2.5 / 3, 1.5 / 2, 9.5 / 10] == pytest.approx(found)
    assert 2 == estimator.learnings


def test_by_default_all_that_is_known_counts_but_nothing_later_than_the_forecast() -> None:
    """Of the past what was known then; of the future what is known now."""
    projection = BeliefProjection(Share(), "UTC")
    told = as_batch([added(), put("open", 0), put("closed", HOUR), put("closed", 3 * HOUR)])
    state = projection.apply(projection.initial(), told)

    found = state.predict(DOOR, np.array([ns_of(HOUR), ns_of(99 * HOUR)]))

    assert [1.5 / 2, 1.5 / 4] == pytest.approx(found.p_open)


def test_one_checkpoint_serves_all_estimators(tmp_path: Path) -> None:
    """It keeps what was told, and not what was made of it."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append(as_batch([added(), seen("open", 0), seen("closed", HOUR)]))
    log, saved = sl.read(tmp_path / "log"), tmp_path / "saved"
    evidence = log.fold(EvidenceProjection(), checkpoint=saved)

    beliefs = log.fold(BeliefProjection(Share(), "Asia/Kathmandu"), checkpoint=saved)

    assert evidence.dump() == beliefs.evidence.dump()
    assert [0, HOUR] == [(ns - ns_of(0)) / 1e9 for ns in beliefs.evidence.door(DOOR).seen_ns]


def test_a_removed_door_keeps_what_it_taught(tmp_path: Path) -> None:
    """Up to its removal; it is still asked for by its id."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append(as_batch([added(), put("open", 0)]))
        log.append([DoorRemoved(door_id=DOOR, happened_ns=ns_of(HOUR))])

    beliefs = sl.read(tmp_path / "log").fold(BeliefProjection(Share(), "UTC"))

    assert [DOOR] == beliefs.door_ids
    assert [1.5 / 2] == beliefs.predict(DOOR, np.array([ns_of(9 * HOUR)])).p_open.tolist()
