"""What RViz, Foxglove and Lichtblick make of MarkerArrays, and which doors that shows."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

CUBE, TEXT = 1, 9
ADD, DELETE, DELETE_ALL = 0, 2, 3

Markers = dict[tuple[str, int], Any]
"""(namespace, id) -> marker."""


@dataclass(frozen=True)
class Seen:
    """A door as somebody sees it; lengths rounded to a micrometre."""

    label: str
    colour: tuple[int, int, int]
    text_colour: tuple[int, int, int]
    start: tuple[float, float, float]
    end: tuple[float, float, float]


def apply_marker_array(shown: Markers, message: Any) -> Markers:
    """Return what is shown after a message, by the rules of visualization_msgs/Marker."""
    after = dict(shown)
    for marker in message.markers:
        if marker.action == DELETE_ALL:
            after.clear()
        elif marker.action == DELETE:
            after.pop((marker.ns, marker.id), None)
        else:
            assert marker.action == ADD
            after[marker.ns, marker.id] = marker
    return after


def shown_after(messages: Iterable[Any]) -> Markers:
    """Return what is shown after messages of one topic."""
    shown: Markers = {}
    for message in messages:
        shown = apply_marker_array(shown, message)
    return shown


def doors_in(shown: Markers) -> dict[int, Seen]:
    """Return the doors that markers show; each has to have both its leaf and its name."""
    assert {number for _, number in shown} == {number for name, number in shown if name == "doors"}
    assert len(shown) == 2 * len({number for _, number in shown})
    return {
        number: _seen(marker, shown["names", number])
        for (name, number), marker in shown.items()
        if name == "doors"
    }


def _seen(leaf: Any, name: Any) -> Seen:
    assert (CUBE, TEXT) == (leaf.type, name.type)
    assert {("map", 0)} == {(m.header.frame_id, m.header.stamp.sec) for m in (leaf, name)}
    where, turn = leaf.pose.position, leaf.pose.orientation
    theta = 2 * math.atan2(turn.z, turn.w)
    half = leaf.scale.x / 2
    floor = where.z - leaf.scale.z / 2
    ends = [
        tuple(round(value, 6) + 0.0 for value in (
            where.x + side * half * math.cos(theta), where.y + side * half * math.sin(theta), floor
        ))
        for side in (-1, 1)
    ]  # fmt: skip
    return Seen(name.text, _rgb(leaf.color), _rgb(name.color), ends[0], ends[1])  # type: ignore[arg-type]


def _rgb(colour: Any) -> tuple[int, int, int]:
    assert colour.a == 1.0
    return round(colour.r * 255), round(colour.g * 255), round(colour.b * 255)
