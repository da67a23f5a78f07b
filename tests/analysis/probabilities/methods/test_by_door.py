"""Each door is learnt by itself, when it is asked for; those asked for lately are kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.by_door import MOST_DAYS, MOST_DOORS, LearntByDoor
from semmap_log.core.model.doors import DoorId
from tests.analysis.probabilities.known import evidence

NOW = np.zeros(1, np.int64)
DOORS = {DoorId(i): DoorEvidence.nothing(DoorId(i), 0) for i in range(1, 30)}


class LearntModel:
    """What was learnt about a door: its own number."""

    def __init__(self, door_id: DoorId) -> None:
        self._p_open = np.array([door_id / 100])

    def predict(self, *_: object) -> Forecast:
        return Forecast.of(self._p_open, self._p_open, self._p_open, np.ones(1, np.bool_))


class Teacher:
    """Who learns, and remembers which doors."""

    def __init__(self) -> None:
        self.taught: list[int] = []

    def __call__(self, door: DoorEvidence) -> LearntModel:
        self.taught.append(door.door_id)
        return LearntModel(door.door_id)


def test_a_door_is_learnt_when_it_is_first_asked_for() -> None:
    """Not before, and not again as long as few others are asked for."""
    teacher = Teacher()
    learnt = LearntByDoor(DOORS, teacher)
    assert [] == teacher.taught

    said = [learnt.predict(DoorId(i), NOW, NOW).p_open[0] for i in (3, 5, 3, 5, 3)]

    assert [0.03, 0.05, 0.03, 0.05, 0.03] == said
    assert [3, 5] == teacher.taught


def test_those_asked_for_lately_are_kept() -> None:
    """The door that was not asked for longest is forgotten, and learnt again if need be."""
    teacher = Teacher()
    learnt = LearntByDoor(DOORS, teacher)
    for i in range(1, MOST_DOORS + 1):
        learnt.door(DoorId(i))
    learnt.door(DoorId(1))

    learnt.door(DoorId(20))

    del teacher.taught[:]
    for i in (1, 20, 2):
        learnt.door(DoorId(i))
    assert [2] == teacher.taught


def test_of_doors_that_were_known_for_years_fewer_are_kept() -> None:
    """Their tables have a row a day; that of the door asked for is kept, however long it is."""
    half = 24.0 * MOST_DAYS / 2
    told = [[(0.0, half, True)], [(0.0, half - 24, True)], [(0.0, 120.0, True)]]
    told.append([(0.0, 4 * half, True)])
    doors = {DoorId(i): replace(evidence(each), door_id=DoorId(i)) for i, each in enumerate(told)}
    teacher = Teacher()
    learnt = LearntByDoor(doors, teacher)

    for i in (0, 1, 0, 2, 0, 1, 3, 3):
        learnt.door(DoorId(i))

    assert [0, 1, 2, 1, 3] == teacher.taught
