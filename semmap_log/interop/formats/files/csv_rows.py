"""Rows of a CSV file: their lines, and where in them the columns are that are found by name."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from semmap_log.errors import FormatError
from semmap_log.interop.formats.parsing.problems import Problems, shown

MOST_LINE_BYTES = 65_536
MOST_ROWS = 50_000_000


class Row(NamedTuple):
    """A row: its line in the file and the texts of the columns asked for."""

    line: int
    texts: list[str]


def places_of(
    header: Row, path: Path, required: tuple[str, ...], optional: tuple[str, ...], *, hint: str = ""
) -> list[int | None]:
    """Return at which place each wanted column stands; None: the file has it not.

    Raises:
        FormatError: A required one is not there, another is, or one is there twice.
    """
    names = [name.strip().lower() for name in header.texts]
    wanted = [*required, *optional]
    expected = ",".join(required) + "".join(f"[,{name}]" for name in optional)
    lacking = [name for name in required if name not in names]
    extra = [name for name in names if name not in wanted]
    twice = [name for name in wanted if names.count(name) > 1]
    if lacking or extra or twice:
        got = shown(",".join(header.texts))
        problem = f"expected a header {expected} (in any order), got {got}{hint}"
        raise FormatError(path, [(header.line, problem)])
    return [names.index(name) if name in names else None for name in wanted]


def has_length(line: int, cells: list[str], length: int, problems: Problems) -> bool:
    """Tell whether a row has as many cells as the header, and note it if not."""
    if len(cells) == length:
        return True
    problems.add(line, f"expected {length} cells as in the header, got {len(cells)}")
    return False
