"""Labels do not cover each other, nor what they must keep clear of."""

import math
from itertools import combinations

from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.views.costmap_picture import FAR_PX, NEAR_PX, LabelPlaces

points = st.tuples(st.floats(0, 300), st.floats(0, 200))


def overlap(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


@settings(deadline=None)
@given(at=st.lists(points, max_size=40), across=st.floats(-4, 4), line=st.tuples(points, points))
def test_no_label_covers_another(at, across, line):
    """Nor leaves the picture, nor lies on a line that is to be kept clear."""
    places = LabelPlaces(300, 200)
    places.keep_clear(*line, margin=3)

    boxes = [places.place(p, (30, 12), across=across, distances=NEAR_PX + FAR_PX) for p in at]

    placed = [box for box in boxes if box is not None]
    assert all(0 <= box[0] and 0 <= box[1] and box[2] <= 300 and box[3] <= 200 for box in placed)
    assert not any(overlap(one, other) for one, other in combinations(placed, 2))
    x, y = (int(a) for a in line[0])
    assert not any(overlap((x, y, x + 1, y + 1), box) for box in placed)


def test_a_label_stands_across_from_its_line():
    """Right beside it where there is room; on the other side next; then farther."""
    places = LabelPlaces(200, 200)
    across = math.pi / 2

    first, second = (
        places.place((100, 100), (30, 10), across=across, distances=NEAR_PX) for _ in range(2)
    )

    assert (85, 105, 115, 115) == first
    assert (85, 85, 115, 95) == second


def test_where_there_is_no_room_there_is_no_label():
    """The caller is told."""
    assert LabelPlaces(20, 20).place((10, 10), (30, 10), across=0, distances=NEAR_PX) is None
