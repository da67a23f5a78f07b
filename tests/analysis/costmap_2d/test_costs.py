"""Costs to map values and back, against the C++ read line by line."""

import ctypes

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    INSCRIBED,
    LETHAL,
    NO_INFORMATION,
    static_costs,
    to_occupancy,
)
from semmap_log.errors import CostmapError

EVERY_BYTE = np.arange(256, dtype=np.uint8)


def published(cost):
    """costmap_2d_publisher.cpp: the table's special values, then its loop."""
    special = {0: 0, 253: 99, 254: 100, 255: -1}
    return special[cost] if cost in special else 1 + (97 * (cost - 1)) // 251


def interpreted(value, *, track_unknown, trinary, lethal_threshold, unknown_value):
    """static_layer.cpp: matchSize's clamping, then interpretValue."""
    threshold = max(min(lethal_threshold, 100), 0)
    unknown = ctypes.c_uint8(unknown_value).value
    if track_unknown and value == unknown:
        return 255
    if not track_unknown and value == unknown:
        return 0
    if value >= threshold:
        return 254
    if trinary:
        return 0
    scale = value / threshold
    return ctypes.c_uint8(int(scale * 254)).value


def test_the_constants_are_ros_s():
    """As in cost_values.h."""
    assert (0, 253, 254, 255) == (FREE_SPACE, INSCRIBED, LETHAL, NO_INFORMATION)


def test_every_cost_is_published_as_ros_publishes_it():
    """All 256."""
    assert [published(cost) for cost in range(256)] == to_occupancy(EVERY_BYTE).tolist()


@pytest.mark.parametrize("track_unknown", [True, False])
@pytest.mark.parametrize("trinary", [True, False])
@settings(deadline=None)
@given(lethal_threshold=st.integers(-10, 300), unknown_value=st.integers(-128, 300))
def test_every_map_value_costs_what_the_static_layer_says(
    track_unknown, trinary, lethal_threshold, unknown_value
):
    """All 256 bytes under any threshold and any value for unknown."""
    options = {
        "track_unknown": track_unknown,
        "trinary": trinary,
        "lethal_threshold": lethal_threshold,
        "unknown_value": unknown_value,
    }

    found = static_costs(EVERY_BYTE.view(np.int8), **options)

    assert [interpreted(value, **options) for value in range(256)] == found.tolist()


def test_a_map_costs_what_a_robot_expects():
    """By default walls are lethal, floor is free, unknown stays unknown."""
    occupancy = np.array([[0, 99], [100, -1], [-2, 50]], np.int8)

    found = static_costs(occupancy)

    assert [[0, 0], [254, 255], [254, 0]] == found.tolist()
    assert np.uint8 == found.dtype


def test_the_wrong_type_is_refused():
    """A signed byte read as a cost, or the other way, would be a wrong grid."""
    with pytest.raises(CostmapError, match="uint8, got int8"):
        to_occupancy(np.zeros((1, 1), np.int8))
    with pytest.raises(CostmapError, match="int8, got uint8"):
        static_costs(np.zeros((1, 1), np.uint8))
