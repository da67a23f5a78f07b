"""The StageDoorSensor: what it notices, and how often."""

from __future__ import annotations

import math
import random

from navigation.door_sensor import DoorSensor

from semmap_log.domain.doors import DoorId

DOOR, OTHER = DoorId(1), DoorId(2)


def test_a_difference_is_noticed_with_ninety_percent() -> None:
    """
    Of 10,000 looks at a shut door that the map has open, within 4 standard errors.
    """
    sensor = DoorSensor(random.Random(5), 0.9)

    told = [sensor.look([DOOR], {DOOR: False}, {DOOR: True}) for _ in range(10_000)]

    assert {((DOOR, False),), ()} == {tuple(each) for each in told}
    error = math.sqrt(0.9 * 0.1 / 10_000)
    assert abs(sum(map(len, told)) / 10_000 - 0.9) < 4 * error


def test_what_is_not_noticed_is_not_told_the_wrong_way_round() -> None:
    sensor = DoorSensor(random.Random(5), 0.0)
    assert sensor.look([DOOR], {DOOR: False}, {DOOR: True}) == []


def test_only_near_doors_that_the_map_has() -> None:
    sensor = DoorSensor(random.Random(5), 1.0)
    world = {DOOR: False, OTHER: False}
    assert sensor.look([OTHER], world, {DOOR: True, OTHER: True}) == [(OTHER, False)]
    assert sensor.look([DOOR, OTHER], world, {OTHER: True}) == [(OTHER, False)]


def test_agreement_is_told_once_a_visit() -> None:
    """
    And again when the robot comes back.
    """
    sensor = DoorSensor(random.Random(5), 1.0)
    states = {DOOR: True}
    looks = [sensor.look(near, states, states) for near in ([DOOR], [DOOR], [], [DOOR])]
    assert looks == [[(DOOR, True)], [], [], [(DOOR, True)]]
