"""Case: the lines of all doors, in cells."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark import plain_costmap
from benchmark.case import Case, Peer, Work
from benchmark.costmaps import ROUNDS
from benchmark.made_building import made_building
from benchmark.peers import OURS
from semmap_log.analysis.costmap_2d.lines import draw_lines

BURST = 20

Cells = NDArray[np.int64]
"""(cells, 3): number of the line, x, y; line after line, each from its start."""


def lines_case(side: int, rounds: int | None) -> Case:
    """Return: from where doors start and end to the cells between.

    Args:
        side: Cells along each edge of the building's map.
        rounds: Rounds that count; None: `ROUNDS`.
    """
    count = len(_corners(side))
    expected = _by_loops(side)
    peers = (
        Peer(OURS, partial(_ours, side), _checksum(expected)),
        Peer("plain Python", partial(_loops, side), _checksum(expected)),
        Peer(f"skimage{_differing(side)}", partial(_skimage, side),
             _checksum(_ends(expected))),
    )  # fmt: skip
    return Case("costmap", f"Lines of {count} doors", "µs", peers, rounds or ROUNDS, BURST)


@cache
def _corners(side: int) -> NDArray[np.int64]:
    """Return the cells where doors start and end (x, y, x, y), each in another direction."""
    building = made_building(side)
    return np.array([
        plain_costmap.corners_of(building.geometry, replace(door, theta=float(number)))
        for number, door in building.doors.items()
    ])  # fmt: skip


def _ours(side: int) -> Work:
    corners, shape = _corners(side), (side, side)
    return Work(
        lambda _: draw_lines(corners[:, :2], corners[:, 2:], shape),
        answer=lambda lines: _checksum(np.column_stack([lines.line, lines.x, lines.y])),
    )


def _loops(side: int) -> Work:
    corners = _corners(side).tolist()
    return Work(
        lambda _: [list(plain_costmap.line(*ends)) for ends in corners],
        answer=lambda lines: _checksum(_numbered(lines)),
    )


def _skimage(side: int) -> Work:
    from skimage.draw import line

    corners = _corners(side).tolist()
    return Work(
        lambda _: [line(y0, x0, y1, x1) for x0, y0, x1, y1 in corners],
        answer=lambda lines: _checksum(_ends(_across_and_up(lines))),
    )


def _by_loops(side: int) -> Cells:
    return _numbered([list(plain_costmap.line(*ends)) for ends in _corners(side).tolist()])


def _across_and_up(lines: Sequence[tuple[Any, Any]]) -> Cells:
    """Return lines that are given as rows and columns."""
    return _numbered([np.column_stack([columns, rows]) for rows, columns in lines])


def _numbered(lines: Sequence[Any]) -> Cells:
    return np.concatenate([
        np.column_stack([np.full(len(cells), number), cells]) for number, cells in enumerate(lines)
    ])  # fmt: skip


def _ends(cells: Cells) -> Cells:
    """Return each line's first and last cell and how many it has: in this all lines agree."""
    first = np.flatnonzero(np.diff(cells[:, 0], prepend=-1))
    count = np.diff(first, append=len(cells))
    return np.column_stack([cells[first], cells[first + count - 1], count])


def _checksum(cells: Cells) -> int:
    return zlib.crc32(np.ascontiguousarray(cells, np.int64))


def _differing(side: int) -> str:
    """Return how many lines of skimage are not the thesis's; nothing if that is not known."""
    try:
        drawn = _skimage(side)
    except ModuleNotFoundError:
        return ""
    theirs, expected = _across_and_up(drawn.once(None)), _by_loops(side)
    differs = (theirs != expected).any(axis=1)
    return f": {len(np.unique(expected[differs, 0]))} lines differ"
