"""The door layer's questions about lines; how it draws them is shown by the layered costmap."""

from __future__ import annotations

from semmap_log.analysis.costmap_2d.costs import LETHAL, DoorLine, are_on_map
from semmap_log.analysis.costmap_2d.grid import GridGeometry


def test_a_door_is_on_the_map_with_a_single_cell() -> None:
    """One that reaches over the edge is."""
    geometry = GridGeometry(10, 10, 0.1)
    lines = [
        DoorLine(x, 0.5, 0.0, width, LETHAL)
        for x, width in ((-0.5, 0.55), (-0.5, 0.4), (1.0, 0.5), (0.95, 0.5), (float("nan"), 1.0))
    ]

    assert [True, False, False, True, False] == are_on_map(geometry, lines).tolist()
    assert [] == are_on_map(geometry, []).tolist()
