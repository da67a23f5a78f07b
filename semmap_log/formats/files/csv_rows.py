"""Rows of a CSV file whose columns are found by name, with their lines, one at a time."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from semmap_log.errors import FormatError
from semmap_log.formats.parsing.foreign_file import text_lines
from semmap_log.formats.parsing.problems import Problems, shown

MOST_LINE_BYTES = 65_536
MOST_ROWS = 50_000_000
ROWS_AT_A_TIME = 65_536


class Row(NamedTuple):
    """A row: its line in the file and the texts of the columns asked for."""

    line: int
    texts: list[str]


def read_rows(
    path: Path, problems: Problems, *, required: tuple[str, ...], optional: tuple[str, ...] = ()
) -> Iterator[list[Row]]:
    """Yield the file's rows, some at a time, with the texts of `required` + `optional` columns.

    An optional column that the file does not have is empty. Rows of another length than the
    header's are noted in `problems`.

    Raises:
        FormatError: The file cannot be read or is not CSV; its header has not those columns.
    """
    reader = csv.reader(text_lines(path, most_bytes=MOST_LINE_BYTES), strict=True)
    rows = _cells(reader, problems)
    header = next(rows, None)
    if header is None:
        raise FormatError(path, f"expected a header {','.join(required)}, got an empty file")
    places = places_of(header, path, required, optional)
    picked = (
        Row(line, [cells[at] if at is not None else "" for at in places])
        for line, cells in rows
        if has_length(line, cells, len(header.texts), problems)
    )
    total = 0
    while chunk := list(islice(picked, ROWS_AT_A_TIME)):
        total += len(chunk)
        if total > MOST_ROWS:
            raise FormatError(path, f"expected at most {MOST_ROWS:,} rows; split the file")
        yield chunk
        if problems.is_full:
            return


def _cells(reader: Iterator[list[str]], problems: Problems) -> Iterator[Row]:
    """Yield every row that is not blank."""
    while True:
        try:
            cells = next(reader, None)
        except csv.Error as error:
            line: int = reader.line_num  # type: ignore[attr-defined]
            raise problems.with_last(line, f"not CSV: {error}") from None
        if cells is None:
            return
        if cells:
            yield Row(reader.line_num, cells)  # type: ignore[attr-defined]


def places_of(
    header: Row, path: Path, required: tuple[str, ...], optional: tuple[str, ...]
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
        problem = f"expected a header {expected} (in any order), got {got}"
        raise FormatError(path, [(header.line, problem)])
    return [names.index(name) if name in names else None for name in wanted]


def has_length(line: int, cells: list[str], length: int, problems: Problems) -> bool:
    """Tell whether a row has as many cells as the header, and note it if not."""
    if len(cells) == length:
        return True
    problems.add(line, f"expected {length} cells as in the header, got {len(cells)}")
    return False
