"""What values the fields of events can have: of one event and of columns, from one table."""

from __future__ import annotations

import copy
import math
import pickle
import re
import sys
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import semmap_log.events
from semmap_log.core.batches.columnar_events import _checks, check_rows, event_of_row
from semmap_log.core.messages import OBJECT_KINDS, fixed_layout
from semmap_log.core.model.doors import LEVEL_NOT_GIVEN, DoorState
from semmap_log.core.model.events import (
    KINDS,
    Changed,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorUpdated,
    FloorMap,
    HistoryTrimmed,
    LevelAdded,
    LogExported,
    MomentPinned,
    Retracted,
    RobotPose,
    field_names,
)
from semmap_log.errors import InvalidEventError

FIXED = [kind for kind in KINDS if kind.kind not in OBJECT_KINDS]
GREATEST = sys.float_info.max
LEAST = math.ulp(0.0)
FLOATS = [
    *(0.0, -0.0, LEAST, -LEAST, 0.5, math.nextafter(0.5, 0), 1.0, math.nextafter(1, 0)),
    *(math.nextafter(1, 2), -1.0, 2.0, GREATEST, -GREATEST, math.inf, -math.inf, math.nan),
]
WHOLES = [0, 1, 4, 5, 30, 31, 32, 255, 65_000, 65_001, 65_535, 2**32 - 1, 2**63 - 1, -1, -(2**63)]

METRES = "a finite number of metres, 0 or more"
SHARE = "a number from 0 to 1"
SURE = "a number from 0.5 to 1"
LEVEL = "a whole number from 0 to 65000"
PATROL = f"a whole number from 0 to {2**32 - 1}"
EVENT = f"a whole number from 0 to {2**63 - 1}"
STATE = "one of UNKNOWN OPEN CLOSED MOVING OFFLINE"

BEFORE_0, BEHIND_1, BEFORE_HALF = -LEAST, math.nextafter(1, 2), math.nextafter(0.5, 0)
WORDS = (
    "two or three different words with a comma between, for OPEN, CLOSED and MOVING, such as "
    "free,taken"
)

EDGES: dict[str, tuple[str, list[Any], list[Any]]] = {
    "door_id": (PATROL, [0, 2**32 - 1], [-1, 2**32, 1.0, True, "1"]),
    "level": (LEVEL, [0, 65_000, LEVEL_NOT_GIVEN], [-1, 65_001, 65_535, 0.0]),
    "state": (STATE, list(DoorState), [0, 5, "OPEN", True]),
    "changed": ("a whole number from 1 to 31", [Changed.STATE, 31 - 3], [Changed(0), 32, 4.0]),
    "prob_open": (SHARE, [0, 1.0, math.nan], [BEFORE_0, BEHIND_1, math.inf]),
    "prob_closed": (SHARE, [0, 1.0, math.nan], [BEFORE_0, BEHIND_1, math.inf]),
    "accuracy_open": (SURE, [0.5, 1.0], [BEFORE_HALF, BEHIND_1, math.nan]),
    "accuracy_closed": (SURE, [0.5, 1.0], [BEFORE_HALF, BEHIND_1, math.nan]),
    "opening": (SHARE, [0, 1.0, math.nan], [BEFORE_0, BEHIND_1, math.inf]),
    "passed": ("True or False", [True, np.False_], [1, "yes"]),
    "waited_s": (
        "a finite number of seconds, 0 or more", [0, GREATEST, math.nan], [BEFORE_0, math.inf]
    ),
    "patrol": (PATROL, [0, 2**32 - 1], [-1, 2**32]),
    "x": ("a finite number", [GREATEST, -GREATEST], [math.nan, math.inf, -math.inf]),
    "y": ("a finite number", [GREATEST, -GREATEST], [math.nan, math.inf, -math.inf]),
    "theta": ("a finite number", [GREATEST, -GREATEST], [math.nan, math.inf, -math.inf]),
    "width": (METRES, [0, GREATEST], [BEFORE_0, math.inf]),
    "sd_xy": (METRES, [0, GREATEST, math.nan], [BEFORE_0, math.inf]),
    "sd_theta": (
        "a finite number of radians, 0 or more", [0, GREATEST, math.nan], [BEFORE_0, math.inf]
    ),
    "first_event": (EVENT, [0, 7], [-1, 2**63]),
    "last_event": (f"a whole number from 7 to {2**63 - 1}", [7, 2**63 - 1], [6, -1, 2**63, "x"]),
    "key": ("a key such as name", ["name"], ["", None]),
    "value": ("a text", ["", "é"], [5, None]),
    "name": ("text without NUL characters", [""], ["a\0"]),
    "elevation": ("a number", [math.nan, math.inf, -1], ["1", True]),
    "resolution": (
        "a finite number of metres above 0 that a float32 can hold",
        [2.0**-149, float(np.finfo(np.float32).max)],
        [0, -1.0, LEAST, GREATEST, math.nan, math.inf],
    ),
    "origin_x": ("a finite number", [0], [math.nan, math.inf]),
    "origin_y": ("a finite number", [0], [math.nan, math.inf]),
    "origin_theta": ("a finite number", [0], [math.nan, math.inf]),
    "cells": (
        "an int8 array (height, width)",
        [np.zeros((0, 0), np.int8)],
        [np.zeros(3, np.int8), np.zeros((1, 1), np.uint8)],
    ),
    "format": ("text that UTF-8 can hold", ["yaml"], ["\ud800"]),
    "file_name": ("a text", [""], [b"a.yaml"]),
    "at_ns": (EVENT, [0, 2**63 - 1], [-1, 2**63, 1.0]),
    "next_event": (EVENT, [0, 2**63 - 1], [-1, 2**63, 1.0]),
    "events_gone": (EVENT, [0, 2**63 - 1], [-1, 2**63]),
    "notes_gone": (EVENT, [0, 2**63 - 1], [-1, 2**63]),
    "horizon": (EVENT, [0, 2**63 - 1], [-1, 2**63]),
    "reasons": ("a text", [""], [5, None]),
    "rule": ("a text", [""], [5, None]),
    "tombstones": ("a text", [""], [5, None]),
    "keyframe": ("a text", [""], [b"eA==", None]),
    "count": (f"a whole number from 1 to {2**32 - 1}", [1, 2**32 - 1], [0, 2**32]),
    "first_ns": (EVENT, [0, 2**63 - 1], [-1, 2**63]),
    "last_ns": (EVENT, [0, 2**63 - 1], [-1, 2**63]),
    "salt": ("", [b"", bytes(16)], []),
    "class_name": (
        "the name of a class, such as dock: no door, and without , and /",
        ["dock", "fire shutter", "d"], ["", " dock", "a,b", "a/b", "Door"],
    ),
    "geometry": ("one of segment polygon point", ["segment", "point"], ["", "line", "POINT"]),
    "states": (
        WORDS,
        ["free,taken", "taken, free , moving", "open,taken", "a,TAKEN,moving"],
        ["", "taken", "taken,Taken", "taken,,free", "taken,open", "a,taken,c,d", "offline,taken"],
    ),
    "blocks": ("some of free,taken, commas between", ["", "taken", "Free , TAKEN"], ["wet", ","]),
}  # fmt: skip
"""Field -> what is said, values at the edge that an event can have, and values behind it."""

PLACED = {"x": 1.0, "y": 2.0, "theta": 0.5, "width": 0.9}
NUMBERS = {"origin_x": 0.0, "origin_y": 0.0, "resolution": 0.05, "first_event": 7, "last_event": 9,
           "next_event": 7, "events_gone": 2, "notes_gone": 1, "horizon": 0,
           "count": 3, "first_ns": 4, "last_ns": 5}  # fmt: skip
TEXTS = {"key": "name", "value": "front", "name": "ground", "format": "yaml", "file_name": "a",
         "reasons": "redacted", "rule": "notes", "tombstones": "ab"}  # fmt: skip
GOOD = {
    **PLACED, **NUMBERS, **TEXTS, "door_id": 1, "level": 0, "state": DoorState.OPEN, "patrol": 1,
    "changed": Changed(31), "passed": True, "at_ns": 5, "cells": np.zeros((2, 3), np.int8),
    "class_name": "dock", "geometry": "point", "states": "free,taken", "blocks": "taken",
}  # fmt: skip
FIELDS = [(kind, name) for kind in KINDS for name in field_names(kind)]


def _event(kind: type[Any], **values: Any) -> Any:
    """Return an event of that kind with good values but for those that are told."""
    return kind(**{name: GOOD[name] for name in field_names(kind) if name in GOOD} | values)


@pytest.mark.parametrize(("kind", "name"), FIELDS)
def test_values_up_to_the_edge_are_those_of_an_event(kind: type[Any], name: str) -> None:
    for value in EDGES[name][1]:
        assert getattr(_event(kind, **{name: value}), name) is value


@pytest.mark.parametrize(("kind", "name"), FIELDS)
def test_a_value_behind_the_edge_is_refused_by_its_name(kind: type[Any], name: str) -> None:
    expected, _, outside = EDGES[name]

    for value in outside:
        with pytest.raises(InvalidEventError, match=re.escape(f"{kind.__name__}.{name}: ")) as said:
            _event(kind, **{name: value})

        assert f"expected {expected}, got " in str(said.value)


NO_NUMBERS = ["1", None, True, b"1"]


@pytest.mark.parametrize(
    ("kind", "name"),
    [(kind, name) for kind in FIXED for name in field_names(kind)
     if fixed_layout(kind.kind).dtype[name].kind == "f"],
)  # fmt: skip
def test_what_is_no_number_is_refused_before_any_range(kind: type[Any], name: str) -> None:
    for value in NO_NUMBERS:
        with pytest.raises(InvalidEventError, match=f"{name}: expected a number, got "):
            _event(kind, **{name: value})


def _bases(kind: type[Any]) -> list[Any]:
    """Return rows of a kind that hold good values, of each way to do so."""
    dtype = fixed_layout(kind.kind).dtype
    row = np.zeros((), dtype)
    for name in dtype.names or ():
        row[name] = GOOD.get(name, 1.0)
    bases = []
    for unplaced, bits in product([False, True], range(1, 32) if kind is DoorUpdated else [0]):
        base = copy.copy(row)
        if bits:
            base["changed"] = bits
        if unplaced and "width" in (dtype.names or ()):
            for name in PLACED:
                base[name] = math.nan
        bases.append(base)
    return bases


def _candidates(dtype: np.dtype[Any]) -> list[Any]:
    """Return values at the edges of all ranges, as far as a column of that type holds them."""
    if dtype.kind == "f":
        return FLOATS
    if dtype.kind == "b":
        return [True, False]
    info = np.iinfo(dtype)
    return [value for value in WHOLES if info.min <= value <= info.max]


def _said(kind: type[Any], row: Any) -> str | None:
    """Return what is wrong with an event of those values; None: nothing."""
    try:
        event_of_row(kind, row, None)
    except InvalidEventError as error:
        return str(error)
    return None


@pytest.mark.parametrize("kind", FIXED)
def test_columns_and_events_agree_on_every_edge(kind: type[Any]) -> None:
    """Each field at a time, whatever else the event holds."""
    dtype = fixed_layout(kind.kind).dtype
    for base in _bases(kind):
        for name in dtype.names or ():
            for value in _candidates(dtype[name]):
                row = copy.copy(base)
                row[name] = value
                rows = np.array([base, row, base])
                fine = _said(kind, base) is None
                said = _said(kind, rows[1])

                assert _passes(kind, rows[1:2]) == (said is None), (row, said)
                if fine and said is None:
                    check_rows(kind, rows)
                elif fine:
                    with pytest.raises(InvalidEventError) as error:
                        check_rows(kind, rows)
                    assert f"row 1: {said}" == str(error.value)


def _passes(kind: type[Any], rows: Any) -> bool:
    """Tell whether the columns' own check finds nothing, whatever the events say."""
    checks = _checks(kind.kind)
    return checks.pass_all(checks.columns_of(rows))


@given(data=st.data())
@pytest.mark.parametrize("kind", FIXED)
def test_columns_name_the_first_row_that_is_no_event(kind: type[Any], data: st.DataObject) -> None:
    """Of any rows whatever: as if they were made into events one by one."""
    dtype = fixed_layout(kind.kind).dtype
    rows = np.array(data.draw(st.lists(st.sampled_from(_bases(kind)), min_size=1, max_size=5)))
    for name in dtype.names or ():
        for i in data.draw(st.lists(st.integers(0, len(rows) - 1), max_size=2)):
            rows[name][i] = data.draw(st.sampled_from(_candidates(dtype[name])))
    said = [f"row {i}: {told}" for i, row in enumerate(rows) if (told := _said(kind, row))]

    assert [_passes(kind, rows[i : i + 1]) for i in range(len(rows))] == [
        _said(kind, row) is None for row in rows
    ]
    if said:
        with pytest.raises(InvalidEventError) as error:
            check_rows(kind, rows)
        assert said[0] == str(error.value)
    else:
        check_rows(kind, rows)


def test_a_wrong_row_far_down_is_named_by_its_place() -> None:
    """Columns are looked at block by block; the place is that among all rows."""
    rows = np.zeros(100_000, fixed_layout(DoorObserved.kind).dtype)
    rows["accuracy_open"] = rows["accuracy_closed"] = 1.0
    rows["accuracy_open"][[70_000, 99_999]] = 0.25

    with pytest.raises(InvalidEventError, match=r"row 70000: DoorObserved.accuracy_open: "):
        check_rows(DoorObserved, rows)


@pytest.mark.parametrize(
    ("kind", "values", "said"),
    [
        (DoorAdded, {"x": math.nan}, "x: expected a finite number, got nan"),
        (DoorAdded, {"y": math.nan}, "y: expected a finite number, got nan"),
        (DoorAdded, {"x": math.nan, "y": math.nan, "theta": math.nan},
         "width: expected a width where there is a pose, and none where there is none, got 0.9"),
        (DoorAdded, {"width": math.nan},
         "width: expected a width where there is a pose, and none where there is none, got nan"),
        (DoorUpdated, {"width": math.nan}, f"width: expected {METRES}, got nan"),
        (DoorUpdated, {"theta": math.nan, "changed": 4}, "theta: expected a finite number, "),
        (Retracted, {"first_event": 10}, f"a whole number from 10 to {2**63 - 1}, got 9"),
    ],
)  # fmt: skip
def test_values_fit_each_other(kind: type[Any], values: dict[str, Any], said: str) -> None:
    with pytest.raises(InvalidEventError, match=re.escape(said)):
        _event(kind, **values)


@pytest.mark.parametrize("width", [-1.0, math.inf, math.nan])
def test_what_an_update_does_not_set_may_be_anything(width: float) -> None:
    """A width alone: a log may hold such updates."""
    event = _event(DoorUpdated, changed=Changed.STATE, width=width)

    assert event.sets() == Changed.STATE
    rows = np.array([_bases(DoorUpdated)[0]])
    rows["changed"], rows["width"] = int(Changed.STATE), width
    check_rows(DoorUpdated, rows)


@pytest.mark.parametrize("value", [np.float32(math.nan), np.float32(0.5), np.float16(1)])
def test_short_floats_are_compared_as_they_are(value: Any) -> None:
    """The greatest number is none of theirs: numpy warns of it where they are asked."""
    assert _event(DoorPassed, waited_s=value).waited_s is value
    assert _event(DoorUpdated, changed=Changed.STATE, width=value).width is value


def test_a_whole_number_that_no_float_holds_is_refused() -> None:
    with pytest.raises(InvalidEventError, match="x: expected a finite number"):
        _event(RobotPose, x=10**400)


def test_the_fields_of_doors_are_those_of_both_kinds() -> None:
    """Told once; construction, order and pickles are as if each class had told them."""
    names = ["level", "x", "y", "theta", "width", "state", "prob_open", "prob_closed"]

    assert ["door_id", *names] == list(field_names(DoorAdded))
    assert ["door_id", "changed", *names] == list(field_names(DoorUpdated))
    for kind in (DoorAdded, DoorUpdated):
        event = _event(kind, prob_open=0.25, prob_closed=0.5)
        assert pickle.loads(pickle.dumps(event)) == event == copy.deepcopy(event)
        assert hash(event) == hash(copy.deepcopy(event))
        assert repr(event).startswith(f"{kind.__name__}(happened_ns=None, door_id=1, ")
        assert not hasattr(event, "__dict__")


def test_every_kind_is_at_the_front_door() -> None:
    """Type checkers read the list as it stands; none is forgotten in it."""
    kinds = {kind.__name__ for kind in KINDS}

    assert kinds <= set(semmap_log.events.__all__)


def test_the_kinds_keep_their_numbers() -> None:
    """They are on disk: the list only grows at its end."""
    assert [
        "DoorAdded", "DoorUpdated", "DoorRemoved", "DoorObserved", "DoorRequested", "DoorPassed",
        "PatrolStarted", "PatrolFinished", "RobotPose", "Retracted", "DoorAnnotated", "LevelAdded",
        "FloorMap", "LogExported", "HistoryTrimmed", "MomentPinned", "SightingsThinned",
        "ClassDefined",
    ] == [kind.__name__ for kind in KINDS]  # fmt: skip
    assert list(range(1, 19)) == [kind.kind for kind in KINDS]


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind in FIXED for name in field_names(kind)]
)
def test_columns_have_room_for_all_that_a_rule_allows(kind: type[Any], name: str) -> None:
    """Those in the messages, and those that are made from the rule alone."""
    rule = kind.rules.fields[name]
    stored, made = fixed_layout(kind.kind).dtype[name], np.dtype(rule.dtype)

    assert (stored.kind in "iu") == (made.kind in "iu")
    for dtype in (stored, made):
        if dtype.kind in "iu":
            info = np.iinfo(dtype)
            assert info.min <= rule.low
            assert rule.high <= info.max
        else:
            assert stored == made


OBJECTS = [
    DoorAnnotated, LevelAdded, FloorMap, LogExported, HistoryTrimmed, MomentPinned, ClassDefined,
]  # fmt: skip


def test_kinds_with_texts_or_cells_are_read_as_objects() -> None:
    assert {kind.kind for kind in OBJECTS} == OBJECT_KINDS
