"""What repeats is told a few times, and counted."""

from __future__ import annotations

from pathlib import Path

import pytest

from semmap_log.core.texts import MOST_KEPT, Repeats, deduplicated
from semmap_log.errors import FormatError
from semmap_log.interop.formats.parsing.problems import MOST_KINDS, Problems


def test_texts_that_differ_in_values_only_are_one_kind() -> None:
    """Quoted texts, numbers and times, cut ones too, are values; words are not."""
    found = Repeats()
    for line, text in enumerate(
        [
            "state: expected OPEN, got 'opn'",
            "state: expected OPEN, got 'it\\'s'",
            "state: expected OPEN, got 'a text that is cut …",
            "door 17 at 2026-03-01T14:02: twice",
            "door 3 at -4.5e3: twice",
            "name: expected OPEN, got 'opn'",
        ],
        start=1,
    ):
        found.add(line, text)

    assert [3, 1, 1, 1] == [kind.count for kind in found]
    assert [3, 4, 5, 6] == [kind.last_line for kind in found]
    assert 6 == found.count


def test_ten_thousand_bad_lines_are_four_and_a_count() -> None:
    """And a single other one among them is not lost."""
    problems = Problems("doors.csv")
    for line in range(2, 10_002):
        problems.add(line, f"state: expected one of OPEN CLOSED, got 'x{line}'")
        if line == 5_000:
            problems.add(line, "expected a door's name")

    with pytest.raises(FormatError) as caught:
        problems.raise_any()

    lines = str(caught.value).splitlines()
    assert [
        "doors.csv:2: state: expected one of OPEN CLOSED, got 'x2'",
        "doors.csv:3: state: expected one of OPEN CLOSED, got 'x3'",
        "doors.csv:4: state: expected one of OPEN CLOSED, got 'x4'",
        "… and 9,997 more like that, the last on line 10001",
        "doors.csv:5000: expected a door's name",
    ] == lines
    assert [10_000, 1] == [kind.count for kind in caught.value.repeats]
    assert MOST_KEPT == max(len(kind.kept) for kind in caught.value.repeats)


def test_few_problems_are_all_told_by_line() -> None:
    """Who mends a file by hand wants each of them."""
    error = FormatError(Path("a.yaml"), [(9, "x: got 3"), (2, "y: bad"), (5, "x: got 4")])

    assert ["a.yaml:2: y: bad", "a.yaml:5: x: got 4", "a.yaml:9: x: got 3"] == (
        str(error).splitlines()
    )


def test_reading_ends_where_there_are_too_many_kinds() -> None:
    """Not where one kind comes again and again."""
    problems = Problems("x")
    for line in range(1, 3 * MOST_KINDS):
        problems.add(line, f"got {line}")
    assert not problems.is_full

    for number in range(MOST_KINDS):
        problems.add(1, "word" + "x" * number)
    assert problems.is_full
    with pytest.raises(FormatError, match=r"more problems in x$"):
        problems.raise_any()


def test_what_is_left_out_is_told_once() -> None:
    """Without lines there is none to name."""
    told = list(deduplicated([*(f"door 'd{n}': no window" for n in range(500)), "lifts: 2"]))

    assert [
        "door 'd0': no window", "door 'd1': no window", "door 'd2': no window",
        "… and 497 more like that", "lifts: 2",
    ] == told  # fmt: skip
