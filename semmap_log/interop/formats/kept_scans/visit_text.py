"""Visits as JSON text."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import isnan, nan
from types import NoneType
from typing import Any

from semmap_log.analysis.scans.kept_visit import DoorLine
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState

_OF_VISIT = {field.name for field in fields(Visit)}
_TYPES: Mapping[object, type | tuple[type, ...]] = {
    "int": int, "float": (int, float, NoneType), "bool": bool, "str": str,
}  # fmt: skip
"""What a field may be of, where its type is called so."""
_EXPECTED = {f.name: _TYPES[f.type] for f in fields(Visit) if f.type in _TYPES}


@dataclass(frozen=True, slots=True)
class ToldVisit:
    """What the text of a visit tells."""

    visit: Visit
    level: int
    line: DoorLine
    stamps_ns: tuple[int, ...]
    """Of its scans."""
    event: int | None


def text_of(told: ToldVisit) -> str:
    """Return the text of a visit."""
    visit = told.visit
    values = {name: getattr(visit, name) for name in sorted(_OF_VISIT)}
    return json.dumps({
        **{name: _null_for_nan(value) for name, value in values.items()},
        "state": visit.state.name,
        "level": told.level,
        "line": told.line,
        "event": told.event,
        "scans_after_ns": [stamp - visit.first_ns for stamp in told.stamps_ns],
    })  # fmt: skip


def read_text(text: str) -> ToldVisit:
    """Return what a text tells; what a later version has added to visits is passed over.

    Raises:
        ValueError: It is not the text of a visit.
    """
    try:
        found: Any = json.loads(text)
        given = {name: _given(found, name) for name in _OF_VISIT & found.keys()}
        visit = Visit(**{
            **given,
            "door_id": DoorId(int(found["door_id"])),
            "state": DoorState[found["state"]],
            "leaves": tuple(_numbers(leaf) for leaf in found.get("leaves", ())),
        })  # fmt: skip
        x, y, theta, width = _numbers(found["line"])
        event = found.get("event")
        return ToldVisit(
            visit,
            int(found["level"]),
            (x, y, theta, width),
            tuple(visit.first_ns + int(after) for after in found["scans_after_ns"]),
            None if event is None else int(event),
        )
    except (
        AttributeError,
        KeyError,
        TypeError,
        ValueError,
        ArithmeticError,
        RecursionError,
    ) as error:
        raise ValueError(f"expected the text of a visit, got {text[:60]!r}") from error


def _null_for_nan(value: Any) -> Any:
    return None if isinstance(value, float) and isnan(value) else value


def _given(found: Mapping[str, Any], name: str) -> Any:
    """Return the value of a field.

    Raises:
        TypeError: It cannot be of the field.
    """
    value, expected = found[name], _EXPECTED.get(name, object)
    if not isinstance(value, expected) or (isinstance(value, bool) and expected is not bool):
        raise TypeError(f"{name}: {value!r}")
    return nan if value is None else value


def _numbers(values: Sequence[Any]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
