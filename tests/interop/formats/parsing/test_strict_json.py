"""What a line of JSON may hold: no more than is read in a few dozen MB."""

from __future__ import annotations

import json

import pytest

from semmap_log.interop.formats.parsing.strict_json import (
    MOST_COMMAS,
    MOST_LINE_BYTES,
    StrictJsonError,
    load_object,
)

MANY = {
    "keys": json.dumps({f"k{i}": 1 for i in range(MOST_COMMAS + 2)}),
    "values": json.dumps({"k": list(range(MOST_COMMAS + 2))}),
    "lists": '{"k":[' + "[]," * (MOST_COMMAS + 1) + "1]}",
}


@pytest.mark.parametrize("text", MANY.values(), ids=MANY)
def test_a_line_of_many_values_is_refused_before_it_is_read(text: str) -> None:
    """As text and as bytes."""
    for line in (text, text.encode()):
        with pytest.raises(StrictJsonError, match="262,144 commas"):
            load_object(line)


def test_a_line_is_as_long_as_a_large_floor_plan() -> None:
    """And no longer."""
    line = '{"cells":"' + "x" * (MOST_LINE_BYTES - 12) + '"}'
    assert load_object(line).keys() == {"cells"}

    with pytest.raises(StrictJsonError, match="at most 16 MiB"):
        load_object(line + " ")
