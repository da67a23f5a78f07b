"""Words that depend on a number, and that nobody writes them by hand."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from semmap_log.core.texts import counted

PACKAGE = Path(__file__).parents[1] / "semmap_log"
NOUNS = (
    "chunks|commits|doors|events|files|grids|hours|lines|messages|poses|rounds|rows|segments"
    "|sightings|states|updates"
)
A_LIMIT = re.compile(r"(at most|expected|expected an? [a-z ]+ of|got|of|holds?|are) $")
"""What stands before a number that somebody set, or that a file tells."""
NEVER_ONE = {
    "cli/compact.py: would merge {len(files)} segments",
    "core/folds/door_index.py:  can mean {len(doors)} doors",
    "interop/importing/import_plan.py: : the log has {len(found)} doors",
    "interop/importing/line_commits.py: {len(found)} doors",
    "views/rerun/recording.py: {level.name} doors",
}
"""Told where there are several, or none; the last is no number."""


@pytest.mark.parametrize(
    ("number", "expected"),
    [(0, "0 events"), (1, "1 event"), (2, "2 events"), (12345, "12,345 events")],
)
def test_one_is_one(number: int, expected: str) -> None:
    """All others are many; thousands have a comma."""
    assert expected == counted(number, "event")


def _number_and_noun(text: ast.JoinedStr) -> list[str]:
    """Return the places of an f-string where a number that is computed stands before a plural."""
    found = []
    for before, value, behind in zip(
        [ast.Constant(""), *text.values], text.values, text.values[1:], strict=False
    ):
        if not isinstance(value, ast.FormattedValue) or not isinstance(behind, ast.Constant):
            continue
        noun = re.match(rf" ({NOUNS})\b", str(behind.value))
        said = str(before.value) if isinstance(before, ast.Constant) else ""
        is_fixed = isinstance(value.value, ast.Name) and value.value.id.isupper()
        if noun and not is_fixed and not A_LIMIT.search(said):
            found.append(f"{said}{{{ast.unparse(value.value)}}} {noun[1]}")
    return found


def test_no_message_counts_one_events() -> None:
    """A number and its noun come from `counted`, in all of the program."""
    found = {
        f"{path.relative_to(PACKAGE).as_posix()}: {place}"
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.JoinedStr)
        for place in _number_and_noun(node)
    }

    assert set() == found - NEVER_ONE
    assert set() == NEVER_ONE - found, "no longer there: take it off the list"
