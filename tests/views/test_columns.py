"""Tables in any width: no line is wider than it, and nothing is lost unless it is named."""

from __future__ import annotations

import io

import pytest
from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from semmap_log.views.column_table import CellValue, ColumnTable, TableColumn, pairs

LONG_NAME = "the door behind the kitchen of the canteen"


def drawn(table: ColumnTable, width: int) -> tuple[list[str], list[str]]:
    """Return the lines as a terminal has them, and the columns left out."""
    found, left_out = table.fitted(width)
    out = io.StringIO()
    Console(file=out, width=width, highlight=False).print(found)
    return [line.rstrip() for line in out.getvalue().splitlines()], left_out


def a_table(*, has_head: bool = True) -> ColumnTable:
    """A table that needs 6 + 8 + 14 columns and two gaps; a fourth column may go."""
    table = ColumnTable(
        [
            TableColumn("event", "event", right=True, width=6),
            TableColumn("kind"),
            TableColumn("state", "the\nstate", width=8),
            TableColumn("what", "what", ratio=3, least=14),
            TableColumn("", "who: why", ratio=2, least=14, yields=1),
        ],
        has_head=has_head,
    )
    table.add("1", "DoorAdded", Text("OPEN"), f"added as {LONG_NAME}", "survey")
    table.add("2", "DoorObserved", CellValue("08:00\n+01:00", "…"), "seen CLOSED", "", style="dim")
    return table


def test_a_column_that_yields_goes_before_any_is_cut() -> None:
    """As long as the others have what they need."""
    lines, left_out = drawn(a_table(), 30)

    assert ["who: why"] == left_out
    assert ["     1 OPEN     added as the", "                door behind"] == lines[2:4]
    assert max(map(cell_len, lines)) <= 30


def test_cells_stand_below_each_other_where_columns_have_no_room() -> None:
    """All of them, those of columns that yield, too; an empty cell needs no line."""
    lines, left_out = drawn(a_table(), 29)

    assert [] == left_out
    assert [
        "event     1",
        "the state OPEN",
        "what      added as the door",
        "          behind the kitchen",
        "          of the canteen",
        "who: why  survey",
        "",
        "event     2",
        "the state 08:00 +01:00",
        "what      seen CLOSED",
    ] == lines


def test_a_page_behind_the_first_begins_with_an_empty_line() -> None:
    """As its rows have between them."""
    first, second = (drawn(a_table(has_head=has), 29)[0] for has in (True, False))

    assert ["", *first] == second


@pytest.mark.parametrize("width", range(8, 60))
def test_at_any_width_each_letter_is_there_or_its_column_is_named(width: int) -> None:
    """And no line is wider than the terminal."""
    lines, left_out = drawn(a_table(), width)
    said = "".join("".join(lines).split())

    assert max(map(cell_len, lines)) <= width
    assert ("survey" in said) != (left_out == ["who: why"])
    for text in ("OPEN", "08:00", "+01:00"):
        assert text in said
    if width < 30:
        assert "".join(f"added as {LONG_NAME}".split()) in said


def test_a_wide_text_takes_no_room_that_another_column_needs() -> None:
    """The rest is shared out only once each has its least width."""
    table = ColumnTable([
        TableColumn("", "name", least=14), TableColumn("", "level", least=3, yields=1),
        TableColumn("", "state"), TableColumn("", "age", right=True),
    ])  # fmt: skip
    table.add(LONG_NAME, "second floor", "CLOSED", "12 min")

    for width in range(32, 90):
        lines, left_out = drawn(table, width)

        assert [] == left_out
        assert [True] == [line.endswith("CLOSED 12 min") for line in lines if "CLOSED" in line]
        assert max(map(cell_len, lines)) <= width


def test_a_value_that_has_no_room_stands_below_its_name() -> None:
    """Whole words stay whole; what has room stays beside."""
    table = pairs(
        [
            ("log id", "ecf82659111b27f58777fbe325cecd6c"),
            ("doors", Text("2")),
            ("", "     69 DoorObserved"),
            ("recorded", "2026-11-23 08:40:59.650+01:00 to 2026-11-23 08:40:59.667+01:00"),
        ]
    )

    assert (
        [
            "log id",
            "  ecf82659111b27f58777fbe325cecd6c",
            "doors     2",
            "               69 DoorObserved",
            "recorded",
            "  2026-11-23 08:40:59.650+01:00 to",
            "  2026-11-23 08:40:59.667+01:00",
        ],
        [],
    ) == drawn(table, 40)
    assert 4 == len(drawn(table, 80)[0])
    assert ["head", f"  {'f' * 50}"] == drawn(pairs([("head", "f" * 50)]), 55)[0]
