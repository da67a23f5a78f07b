"""The oracle against the shipped recordings: it says what a replay does, and `probabilities`.

What is expected is worked out here, from the files of states that the recordings' maker folded by
hand, and from the answers of `replay` and `probabilities`; nothing of the oracle is used for it.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs import best_time, probabilities
from semmap_log.live.planners.door_view import LearntDoors
from tests.live.planners.asker import Asker

RECORDINGS = Path(__file__).parents[3] / "recordings"
HOUR_NS = 3600 * 10**9
MOST_IDS = 136


@pytest.fixture(scope="module", params=["office", "clinic_week"])
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def ask(name: str) -> Iterator[Asker]:
    asker = Asker(RECORDINGS / name, is_read_only=True)
    yield asker
    asker.close()


@pytest.fixture
def clinic() -> Iterator[Asker]:
    asker = Asker(RECORDINGS / "clinic_week", is_read_only=True)
    yield asker
    asker.close()


def _questions(doors: dict[int, tuple[str, float | None, float | None]]) -> dict[str, str]:
    """Return questions of state, and what they are to be answered.

    Args:
        doors: Id -> state, P(open), P(closed); None: not given.
    """
    found = {}
    for door_id in range(MOST_IDS):
        state, *shares = doors.get(door_id, ("GONE", None, None))
        word = f"DOOR_{door_id}"
        known = state in ("OPEN", "CLOSED", "MOVING", "OFFLINE")
        found[f"DOOR_STATE_KNOWN {word}"] = "T" if known else "NIL"
        found[f"DOOR_OPEN {word}"] = "T" if state == "OPEN" else "NIL"
        found[f"DOOR_CLOSED {word}"] = "T" if state == "CLOSED" else "NIL"
        found[f"DOOR_STATE {word}"] = "NIL" if state == "GONE" else state
        for which, share in zip(("OPEN", "CLOSED"), shares, strict=True):
            found[f"PROBABILITY_DOOR_{which} {word}"] = "NIL" if share is None else repr(share)
    for state in ("OPEN", "CLOSED"):
        ids = sorted(i for i, (is_so, *_) in doors.items() if is_so == state)
        found[f"GET_{state}_DOOR"] = f"DOOR_{ids[0]}" if ids else "NIL"
        found[f"DOORS {state}"] = f"({' '.join(f'DOOR_{i}' for i in ids)})"
    found["DOORS"] = f"({' '.join(f'DOOR_{i}' for i in sorted(doors))})"
    return found


def _asked(question: str, at: object, known_at: object) -> str:
    """Return the question as one about a moment."""
    if at is not None:
        question += f" {at}"
    return question if known_at is None else f"BELIEVED {question} AT {known_at}"


def test_the_states_that_the_recordings_ship_with(ask: Asker, name: str) -> None:
    """At each of their moments: what was true, what was believed, both, and after an event."""
    moments: list[dict[str, Any]] = json.loads((RECORDINGS / f"{name}.expected.json").read_text())
    for moment in moments:
        doors = {
            door["door_id"]: (door["state"], door["prob_open"], door["prob_closed"])
            for door in moment["doors"]
        }
        expected = _questions(doors)
        event = moment["event"]
        known_at = moment["known_at"] if event is None else f"event:{event}"
        got = {each: ask(_asked(each, moment["at"], known_at)) for each in expected}
        assert expected == got, moment["about"]


def test_random_moments(ask: Asker, name: str) -> None:
    """As `replay` has them: at, known at, and both."""
    dice, log = random.Random(7), sl.read(RECORDINGS / name)
    begin_ns = log.event(0).recorded_ns

    for _ in range(12):
        at, known_at = (dice.randrange(begin_ns - HOUR_NS, log.end_ns() + HOUR_NS) for _ in "ab")
        at, known_at = dice.choice([(at, None), (None, known_at), (at, known_at)])
        doors = {
            int(door_id): (door.state.name, *(None if math.isnan(p) else p for p in
                                              (door.prob_open, door.prob_closed)))
            for door_id, door in log.replay(at=at, known_at=known_at).doors.items()
        }  # fmt: skip
        expected = _questions(doors)
        moment = [None if ns is None else f"@{ns}" for ns in (at, known_at)]
        assert expected == {each: ask(_asked(each, *moment)) for each in expected}


@pytest.mark.slow
def test_what_is_likely(clinic: Asker) -> None:
    """As `probabilities` says: ahead by what is known now, within a day and beyond it."""
    dice, log = random.Random(11), sl.read(RECORDINGS / "clinic_week")
    now_ns = log.end_ns()
    times = [now_ns, *(now_ns + dice.randrange(60 * HOUR_NS) for _ in range(4)),
             *(now_ns - dice.randrange(100 * HOUR_NS) for _ in range(3))]  # fmt: skip
    known = 0
    for time_ns in times:
        said = (
            probabilities(log, horizon_ns=time_ns - now_ns)
            if time_ns >= now_ns
            else probabilities(log, at=time_ns)
        )
        for belief in dice.sample(said, 10):
            word = f"DOOR_{belief.door.door_id}"
            known += belief.is_known
            answers = [
                clinic(f"PROBABILITY_DOOR_{which} {word} AT @{time_ns}")
                for which in ("OPEN", "CLOSED")
            ]
            if belief.is_known:
                # `probabilities` sums up many doors at once: the last digits differ.
                expected = pytest.approx([belief.p_open, belief.p_closed], rel=1e-9, abs=0)
                assert [float(each) for each in answers] == expected
            else:
                assert ["NIL", "NIL"] == answers
        sample = dice.sample(said, 5)
        best = max(sample, key=lambda each: each.p_open).door.door_id
        words = " ".join(f"DOOR_{each.door.door_id}" for each in sample)
        assert f"DOOR_{best}" == clinic(f"NEXT_DOOR DOOR_9999 {words} AT @{time_ns}")
    assert 40 < known


@pytest.mark.slow
def test_when_to_go(clinic: Asker) -> None:
    """The likeliest of the hours that `best_time` names."""
    log = sl.read(RECORDINGS / "clinic_week")
    for door, state in ((1, "OPEN"), (5, "OPEN"), (1, "CLOSED"), (13, "CLOSED")):
        hours = best_time(log, door, state.lower()).next_ones
        likeliest = max(each.probability for each in hours)
        begin, end, said = clinic.json("BEST_TIME", door, state)["answer"]
        assert likeliest == said
        assert (log.moment(begin).ns, log.moment(end).ns, said) in [
            (each.start_ns, each.end_ns, each.probability) for each in hours
        ]


def test_a_door_that_is_named_often_is_looked_at_once(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked_at: list[int] = []

    def p_open(_: object, log: object, event: int, door: int, **times: int) -> tuple[float, bool]:
        looked_at.append(door)
        return 0.25 * door, True

    monkeypatch.setattr(LearntDoors, "p_open", p_open)
    ask = Asker(path)
    words = "DOOR_1 DOOR_main_door main_door DOOR_2 DOOR_99 id:1 DOOR_2 " * 100

    assert "DOOR_2" == ask(f"NEXT_DOOR {words}")
    ask.close()
    assert [1, 2] == looked_at


def test_nothing_is_learnt_twice(tmp_path: Path) -> None:
    """Two threads ask, and the one that saw less of the log comes second."""
    learnt = LearntDoors()
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(state="closed")
        for event in (0, 1, 3, 2, 4):
            while log._reader.last_event() < event:
                log.observe(door, "open", accuracy=0.9)
            now_ns = log.now_ns()
            learnt.p_open(log, event, door, now_ns=now_ns, time_ns=now_ns)

    (beliefs,) = {id(each.evidence): each for each in learnt._by_estimator.values()}.values()
    assert 5 == len(beliefs.evidence)


def test_what_is_learnt_goes_on_with_the_log(tmp_path: Path) -> None:
    """As if it were learnt anew: after each event, a late one, a retraction."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        doors = [log.add_door(name=f"d{i}", at="2026-03-01T00:00") for i in range(3)]
        for hour in range(24 * 8):
            is_day = 8 < hour % 24 < 18
            for door in doors:
                log.observe(door, "open" if is_day else "closed", accuracy=0.9,
                            at=log.instant("2026-03-01T00:30") + hour * HOUR_NS)  # fmt: skip
    ask = Asker(path, clock_ns=lambda: 0)  # now is the log's end
    log = ask.doors.log

    def change_and_compare() -> None:
        ask.oracle.refresh()
        end_ns = log.end_ns()
        for belief in probabilities(log, horizon_ns=2 * HOUR_NS):
            said = ask.json("PROBABILITY_DOOR_OPEN", belief.door.door_id, "AT",
                            end_ns + 2 * HOUR_NS)["answer"]  # fmt: skip
            assert belief.is_known
            assert math.isclose(belief.p_open, said, rel_tol=1e-9)

    change_and_compare()
    learnt = ask.oracle._likely._learnt._by_estimator["filter"]
    appended = log.observe(1, "open", accuracy=0.9, at="2026-03-09T01:00")
    change_and_compare()
    log.observe(2, "open", accuracy=0.9, at="2026-03-07T12:45")
    change_and_compare()
    assert learnt is ask.oracle._likely._learnt._by_estimator["filter"]
    log.retract(appended.first_event)
    change_and_compare()
    ask.close()
