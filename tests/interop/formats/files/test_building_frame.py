"""The one frame of an Open-RMF building: levels lie over each other by their fiducials."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.building import read_building
from semmap_log.interop.formats.files.door_table import DoorTable

# A pixel of the ground is 0.05 m; its door starts at 40, 40 px: (2, -2).
GROUND = """
  ground:
    elevation: 0
    vertices: [[40, 40, 0, ""], [60, 40, 0, ""], [0, 0, 0, ""], [100, 0, 0, ""]]
    measurements: [[2, 3, {distance: [3, 5.0]}]]
    doors: [[0, 1, {name: [1, low]}]]
"""
FIDUCIALS = "    fiducials: [[0, 0, a], [100, 0, b], [100, 100, c]]\n"
MEASURED = "    measurements: [[0, 1, {distance: [3, 1.0]}]]\n"


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., DoorTable]:
    def read(
        upper: str, *, ground: str = GROUND + FIDUCIALS, head: str = "", level: str | None = None
    ) -> DoorTable:
        path = tmp_path / "mill.building.yaml"
        path.write_text(f"{head}\nlevels:{ground}  upper:\n    elevation: 4\n{upper}")
        return read_building(path, level=level)

    return read


def upper(fiducials: str, more: str = "") -> str:
    """Return a level on which a door goes from 40, 40 to 60, 40 px."""
    return (
        '    vertices: [[40, 40, 0, ""], [60, 40, 0, ""]]\n'
        f"    doors: [[0, 1, {{name: [1, high]}}]]\n    fiducials: {fiducials}\n{more}"
    )


def _place(table: DoorTable) -> tuple[float, ...]:
    door = table.doors[-1]
    return door.x, door.y, door.theta, door.width


@pytest.mark.parametrize(
    ("fiducials", "expected"),
    [
        pytest.param("[[0, 0, a], [100, 0, b], [100, 100, c]]", (2, -2, 0, 1), id="same"),
        pytest.param("[[20, 10, a], [120, 10, b], [120, 110, c]]", (1, -1.5, 0, 1), id="shifted"),
        pytest.param("[[0, 0, a], [50, 0, b], [50, 50, c]]", (4, -4, 0, 2), id="scaled"),
        pytest.param("[[0, 0, a], [0, -100, b], [100, -100, c]]", (-2, -2, -math.pi / 2, 1),
                     id="turned"),
        pytest.param("[[7, 7, other], [50, 0, b], [0, 0, a]]", (4, -4, 0, 2), id="two in common"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("more", ["", MEASURED])
def test_a_level_lies_by_its_fiducials(
    read: Callable[..., DoorTable], fiducials: str, expected: tuple[float, ...], more: str
) -> None:
    """Its own measurements do not count, and need not be there."""
    table = read(upper(fiducials, more))

    assert expected == pytest.approx(_place(table))
    assert () == table.warnings
    assert [level.name for level in table.levels] == ["ground", "upper"]


def test_points_that_were_not_clicked_exactly_are_averaged_as_in_open_rmf(
    read: Callable[..., DoorTable],
) -> None:
    """As Transform.set_from_fiducials prints for these points: the mean turn, the mean scale."""
    table = read(upper("[[0, 0, a], [101, 2, b], [98, 103, c]]"))

    turns = [
        math.atan2(-2, 101) - 0.0,
        math.atan2(-103, 98) - math.atan2(-100, 100),
        math.atan2(-101, -3) - math.atan2(-100, 0),
    ]
    turn = -math.atan2(sum(map(math.sin, turns)), sum(map(math.cos, turns)))
    scale = (math.hypot(101, 2) / 100 + math.hypot(98, 103) / math.hypot(100, 100)
             + math.hypot(3, 101) / 100) / 3  # fmt: skip
    assert (turn, 20 * 0.05 / scale) == pytest.approx(_place(table)[2:], rel=1e-12)


def test_only_the_level_that_is_asked_for_lies_as_in_the_whole(
    read: Callable[..., DoorTable],
) -> None:
    """The reference level is read for its fiducials, though it is not asked for."""
    (door,) = read(upper("[[0, 0, a], [50, 0, b]]"), level="upper").doors

    assert (4.0, -4.0) == pytest.approx((door.x, door.y))


@pytest.mark.parametrize("fiducials", ["[]", "[[0, 0, a]]", "[[5, 5, a], [5, 5, b]]",
                                       "[[0, 0, a], [9, 9, a], [50, 0, a]]"])  # fmt: skip
def test_without_two_common_fiducials_its_own_measurements_count(
    read: Callable[..., DoorTable], fiducials: str
) -> None:
    """A word says that its drawing may lie otherwise; without measurements it is refused."""
    table = read(upper(fiducials, MEASURED))

    assert (2.0, -2.0, 0.0, 1.0) == pytest.approx(_place(table))
    (warning,) = table.warnings
    assert "level upper: expected two fiducials that level ground has, too" in warning
    with pytest.raises(FormatError, match=r"level .upper.: expected a measurement, .* or two fid"):
        read(upper(fiducials))


def test_the_reference_level_may_be_named(read: Callable[..., DoorTable]) -> None:
    """Then the first of the file lies by it: 0.1 m a pixel, and the ground drawn half as large."""
    more = MEASURED.replace("1.0", "2.0")
    table = read(upper("[[0, 0, a], [50, 0, b]]", more), head="reference_level_name: upper")

    low, high = table.doors
    assert (4.0, -4.0, 2.0) == pytest.approx((high.x, high.y, high.width))
    assert (2.0, -2.0, 1.0) == pytest.approx((low.x, low.y, low.width))
    with pytest.raises(FormatError, match="reference_level_name"):
        read(upper("[]", MEASURED), head="reference_level_name: cellar")
