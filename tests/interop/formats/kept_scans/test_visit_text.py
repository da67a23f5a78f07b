"""The text of a visit that is kept: what it cannot say is refused, whoever wrote it."""

from __future__ import annotations

import json
from typing import Any

import pytest

from semmap_log.interop.formats.kept_scans.scan_messages import VisitRecord, read_text, text_of
from tests.analysis.scans.some_visits import some_visit

TOLD = VisitRecord(some_visit(laser="laser"), 0, (1.0, 2.0, 0.5, 0.9), (), 7)


def test_a_text_tells_what_it_was_told() -> None:
    """NaN is null; a number without a point is one, too."""
    text = json.loads(text_of(TOLD))

    assert text["behind_m"] is None
    assert TOLD.visit.last_ns == read_text(text_of(TOLD)).visit.last_ns
    assert 7.0 == read_text(json.dumps({**text, "near": 7})).visit.near


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("first_ns", "1"), ("last_ns", "x"), ("last_ns", None), ("last_ns", 1.5), ("scans", "q"),
        ("scans", True), ("accuracy", "0.9"), ("looks", [1]), ("ajar", False), ("passed", "no"),
        ("passed", 1), ("why", 5), ("laser", [1]), ("robot", None), ("side", "left"),
        ("behind_m", "b"),
    ],
)  # fmt: skip
def test_values_that_cannot_be_are_refused(name: str, value: Any) -> None:
    """Before anybody counts with them."""
    text = json.dumps({**json.loads(text_of(TOLD)), name: value})

    with pytest.raises(ValueError, match="expected the text of a visit"):
        read_text(text)


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"door_id": ' * 100_000, '{"door_id": Infinity, "state": "OPEN"}', "1"]
)
def test_texts_that_no_recorder_wrote_are_refused(text: str) -> None:
    """Nested without end, or with a number that is none."""
    with pytest.raises(ValueError, match="expected the text of a visit"):
        read_text(text)
