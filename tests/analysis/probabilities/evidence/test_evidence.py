"""What a word about a door means, rule by rule."""

from __future__ import annotations

import math

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.evidence import (
    Counts,
    DoorEvidence,
    Evidence,
    EvidenceProjection,
)
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, SightingsThinned
from tests.analysis.probabilities.telling import (
    DOOR,
    LATER_NS,
    Told,
    added,
    as_batch,
    known,
    ns_of,
    passed,
    points,
    put,
    removed,
    seen,
    stretches,
    told_of,
)
from tests.batches import batch_of
from tests.calls import calls_of

HOUR, DAY = 3600, 86_400
LOG_9 = math.log(9)
"""What one reading of a 90 % sensor tells, in nats."""


RULES = {
    "a state that was set is known until the next word": (
        (added(), put("closed", 0), put("open", 50), put("closed", 60)),
        60, [(0, 50, "closed"), (50, 60, "open"), (60, 60, "closed")], [],
    ),
    "the same state again is no change": (
        (added("open"), put("open", 10), put("open", 20), put("closed", 30)),
        40, [(0, 30, "open"), (30, 40, "closed")], [],
    ),
    "silence of thirty days is a gap": (
        (added(), put("open", 0), put("closed", 40 * DAY)),
        100 * DAY, [(0, 30 * DAY, "open"), (40 * DAY, 70 * DAY, "closed")], [],
    ),
    "a sighting that agrees prolongs what was set": (
        (added(), put("open", 0), seen("open", 30 * DAY)),
        100 * DAY, [(0, 60 * DAY, "open")], [],
    ),
    "a sighting that is too late to prolong stands for itself": (
        (added(), put("open", 0), seen("open", 31 * DAY)),
        100 * DAY, [(0, 30 * DAY, "open")], [(31 * DAY, "open")],
    ),
    "a sighting that disagrees ends what was set": (
        (added(), put("open", 0), seen("closed", HOUR), seen("open", 2 * HOUR)),
        DAY, [(0, HOUR, "open")], [(HOUR, "closed"), (2 * HOUR, "open")],
    ),
    "what a map says at first gives way to any sighting": (
        (added("closed"), seen("closed", HOUR), seen("open", 2 * HOUR)),
        DAY, [(0, HOUR, "closed")], [(HOUR, "closed"), (2 * HOUR, "open")],
    ),
    "a removed door is known up to its removal": (
        (added(), put("open", 0), removed(HOUR), seen("closed", DAY)),
        2 * DAY, [(0, HOUR, "open")], [],
    ),
    "what is told before a door is added does not count": (
        (seen("open", 0), put("open", 10), added("closed", at_s=20)),
        30, [(20, 30, "closed")], [],
    ),
}  # fmt: skip
"""What is told, until when it is known, and the stretches and sightings that it makes."""


@pytest.mark.parametrize("rule", RULES)
def test_words_make_stretches_and_sightings(rule: str) -> None:
    told, until_s, held, sightings = RULES[rule]
    found = known(*told, until_s=until_s)

    assert held == stretches(found)
    assert sightings == points(found)


@pytest.mark.parametrize("state", ["unknown", "moving", "offline"])
@pytest.mark.parametrize("word", [put, seen])
def test_a_state_that_is_none_begins_a_gap(word: object, state: str) -> None:
    """An outage is not "closed", and not "as before"; whether it was set or seen."""
    found = known(added(), put("open", 0), word(state, 10), put("open", 30), until_s=40)

    assert [(0, 10, "open"), (30, 40, "open")] == stretches(found)
    assert [] == points(found)


def test_who_went_through_saw_it_open_and_who_gave_up_saw_nothing() -> None:
    """DoorPassed is a certain sighting."""
    found = known(added(), passed(HOUR), passed(2 * HOUR, through=False))

    assert [(HOUR, "open")] == points(found)
    assert [(1.0, 1.0)] == list(zip(found.accuracy_open, found.accuracy_closed, strict=True))
    assert [math.log(0.999 / 0.001)] == pytest.approx(found.llr)


def test_a_sensors_two_accuracies_count_apart() -> None:
    """Of one that rarely reads open by mistake, open tells more; a coin tells nothing."""
    found = known(added(), seen("open", 0, (0.7, 0.95)), seen("closed", HOUR, (0.7, 0.95)),
                  seen("open", 2 * HOUR, 0.5), seen("closed", 3 * HOUR, 0.5))  # fmt: skip

    assert [math.log(0.7 / 0.05), math.log(0.3 / 0.95), 0, 0] == pytest.approx(found.llr)


def test_a_hundred_sightings_in_ten_seconds_tell_as_much_as_one() -> None:
    """One visit; a burst must not prove anything."""
    found = known(added(), *(seen("open", 0.1 * i) for i in range(100)))

    assert LOG_9 == pytest.approx(found.llr.sum())
    assert 1 == found.is_visit.sum()


def test_sightings_of_a_pass_add_up_to_their_mean() -> None:
    """At each of them: three OPEN and one CLOSED are half as much as one OPEN."""
    told = [seen("open", 0), seen("open", 10), seen("closed", 20), seen("open", 30)]

    found = known(added(), *told)

    assert [LOG_9, LOG_9, LOG_9 / 3, LOG_9 / 2] == pytest.approx(np.cumsum(found.llr))
    assert [True, False, False, False] == found.is_visit.tolist()


@pytest.mark.parametrize(
    ("told", "visits"),
    [
        ([seen("open", s) for s in (0, 59.9, 119.9, 150)], [0, 0, 1, 1]),
        ([seen("open", 50 * i) for i in range(20)], [0] * 7 + [1] * 7 + [2] * 6),
        ([seen("closed", 0), put("open", 5), seen("closed", 10)], [0, 1]),
    ],
    ids=["a minute of silence", "five minutes", "a word that is no sighting"],
)
def test_what_ends_a_pass(told: list[Told], visits: list[int]) -> None:
    assert visits == known(added(), *told).visit.tolist()


def test_sensors_that_look_at_the_same_time_make_visits_of_their_own() -> None:
    """A camera and a laser, reading by turns, are two proofs: no more, and no less."""
    told = [seen("open", i, 0.9 if i % 2 else 0.8) for i in range(20)]

    found = known(added(), *told)

    assert 2 == found.is_visit.sum()
    assert LOG_9 + math.log(4) == pytest.approx(found.llr.sum())


def test_a_certain_sighting_is_a_visit_for_itself() -> None:
    """It saw the door change: what was read before is not averaged with what comes."""
    found = known(added(), seen("closed", 0), seen("open", 5, 1.0), seen("closed", 9, 1.0),
                  seen("closed", 10))  # fmt: skip

    assert [0, 1, 2, 3] == found.visit.tolist()
    assert [-LOG_9, math.log(999), -math.log(999), -LOG_9] == pytest.approx(found.llr)


def test_a_late_word_takes_its_place() -> None:
    """The log learns of the closing last, and after somebody asked."""
    evidence = told_of(added(), put("open", 0), put("open", 100))
    before = stretches(evidence.door(DOOR, ns_of(200)))

    evidence.apply(batch_of([*as_batch([put("closed", 40)]).to_events()], first_number=3,
                            recorded_ns=[LATER_NS + 9]))  # fmt: skip

    assert [(0, 200, "open")] == before
    assert [(0, 40, "open"), (40, 100, "closed"), (100, 200, "open")] == stretches(
        evidence.door(DOOR, ns_of(200))
    )


def test_a_time_later_than_its_recording_counts_as_that() -> None:
    """A clock that runs ahead does not tell of the future."""
    evidence = Evidence()
    events = [
        DoorAdded(door_id=DOOR, happened_ns=0),
        DoorObserved(door_id=DOOR, state=DoorState.OPEN, happened_ns=500),
    ]

    evidence.apply(batch_of(events, recorded_ns=[100, 200]))

    assert [200] == evidence.door(DOOR).seen_ns.tolist()
    assert 200 == evidence.latest_ns


def test_only_what_a_word_is_about_is_made_anew() -> None:
    """Asking again costs nothing, nor do words about other doors."""
    evidence = told_of(added(), put("open", 0))
    first = evidence.door(DOOR)

    evidence.apply(batch_of([DoorAdded(door_id=DoorId(2))], first_number=2))
    again = evidence.door(DOOR)

    assert np.shares_memory(first.start_ns, again.start_ns)


def test_a_door_nobody_told_of_is_one_nothing_is_known_of() -> None:
    """Empty columns, no error."""
    found = told_of(added()).door(DoorId(7), 12)

    assert ([], []) == (stretches(found), points(found))
    assert 12 == found.until_ns
    assert Counts(0, 0, 0, None) == told_of(added()).counts(DoorId(7))
    assert stretches(found) == stretches(DoorEvidence.nothing(DoorId(7), 12))


def test_counts_say_how_much_was_told_up_to_a_time() -> None:
    """UNKNOWN is a word, and no sighting of anything."""
    told = (added(), put("open", 0), seen("open", 10), seen("closed", 20), seen("closed", 30),
            seen("unknown", 40), put("closed", 50))  # fmt: skip
    evidence = told_of(*told)

    found = evidence.counts(DOOR), evidence.counts(DOOR, ns_of(15))

    assert Counts(words=7, sightings=3, visits=1, last_seen_ns=ns_of(50)) == found[0]
    assert Counts(words=3, sightings=1, visits=0, last_seen_ns=ns_of(10)) == found[1]


def test_doors_are_a_mapping_made_when_asked_for() -> None:
    """What an estimator learns from: of those told of, ids ascending."""
    evidence = told_of(added(), put("open", 0), put("closed", 10))
    evidence.apply(batch_of([DoorAdded(door_id=DoorId(9))], first_number=3))

    doors = evidence.up_to(ns_of(5))

    assert [1, 9] == list(doors)
    assert 2 == len(doors)
    assert [(0, 5, "open")] == stretches(doors[DOOR])
    with pytest.raises(KeyError):
        doors[DoorId(2)]


@pytest.mark.parametrize("cut", [0, 7, 8, 100, -1])
def test_bytes_that_are_no_evidence_are_refused(cut: int) -> None:
    """With the error that a checkpoint expects of damage."""
    data = told_of(added(), seen("open", 0)).dump()

    with pytest.raises(ValueError, match=r".+"):
        EvidenceProjection().load(data[:cut])


@pytest.mark.slow
def test_a_million_sightings_are_folded_and_asked_in_seconds() -> None:
    """As columns, without a loop over them: 0.9 s on one core."""
    count, dice = 1_000_000, np.random.default_rng(7)
    doors = np.arange(1, 101, dtype=np.uint32)
    sightings = EventBatch.of(
        DoorObserved,
        door_id=dice.choice(doors, count),
        state=dice.integers(1, 3, count).astype(np.uint8),
        happened_ns=np.sort(dice.integers(0, 10**16, count)),
        accuracy_open=0.9,
        accuracy_closed=0.8,
    )
    evidence = Evidence()
    evidence.apply(EventBatch.of(DoorAdded, door_id=doors, happened_ns=0))

    kept = []

    def fold_and_ask() -> None:
        for part in sightings.parts(10_000):
            evidence.apply(part)
        kept.extend(len(evidence.door(door).seen_ns) for door in evidence.door_ids)

    calls = calls_of(fold_and_ask)

    assert count == sum(kept)
    assert calls.total() < count / 10


def test_a_run_that_was_taken_out_costs_no_more_than_an_hour_of_looks() -> None:
    """However many sightings over how many years a stranger's log says that it stands for."""
    evidence = Evidence()
    evidence.apply(EventBatch.of(DoorAdded, happened_ns=np.array([0]), door_id=1))

    evidence.apply(
        EventBatch.of(
            SightingsThinned, happened_ns=np.array([MAX_TIME_NS]), door_id=1, state=1,
            count=2**32 - 1, accuracy_open=0.9, accuracy_closed=0.9, first_ns=0,
            last_ns=MAX_TIME_NS,
        )
    )  # fmt: skip

    found = evidence.door(DoorId(1), MAX_TIME_NS)
    assert len(found.seen_ns) <= 4096
    assert found.seen_ns[-1] - found.seen_ns[0] <= 3600 * 10**9
    assert 12 <= np.count_nonzero(found.is_visit) <= 13
