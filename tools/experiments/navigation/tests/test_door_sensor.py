"""The StageDoorSensor: what it notices, and how often."""

from __future__ import annotations

import math
import random

from navigation.door_sensor import DoorSensor
from semmap_log.core.model.doors import DoorId

DOOR, OTHER = DoorId(1), DoorId(2)


def test_a_difference_is_noticed_with_ninety_percent() -> None:
    """
    Of 10,000 looks at a shut door that the map has open, within 4 standard errors.
    """
    sensor = DoorSensor(random.Random(5), 0.9)

    told = [sensor.look(0.0, [DOOR], {DOOR: False}, {DOOR: True}) for _ in range(10_000)]

    assert {((DOOR, False),), ()} == {tuple(each) for each in told}
    error = math.sqrt(0.9 * 0.1 / 10_000)
    assert abs(sum(map(len, told)) / 10_000 - 0.9) < 4 * error


def test_what_is_not_noticed_is_not_told_the_wrong_way_round() -> None:
    sensor = DoorSensor(random.Random(5), 0.0)
    assert sensor.look(0.0, [DOOR], {DOOR: False}, {DOOR: True}) == []


def test_only_near_doors_that_the_map_has() -> None:
    sensor = DoorSensor(random.Random(5), 1.0)
    world = {DOOR: False, OTHER: False}
    assert sensor.look(0.0, [OTHER], world, {DOOR: True, OTHER: True}) == [(OTHER, False)]
    assert sensor.look(0.0, [DOOR, OTHER], world, {OTHER: True}) == [(OTHER, False)]


def test_agreement_is_told_once_a_minute() -> None:
    """
    And when the robot comes back.
    """
    sensor = DoorSensor(random.Random(5), 1.0)
    states = {DOOR: True}
    times_s = [0.0, 1.0, 59.0, 60.0, 61.0, 119.0, 120.0]
    told = [at_s for at_s in times_s if sensor.look(at_s, [DOOR], states, states)]
    assert told == [0.0, 60.0, 120.0]
    assert sensor.look(121.0, [], states, states) == []
    assert sensor.look(122.0, [DOOR], states, states) == [(DOOR, True)]
