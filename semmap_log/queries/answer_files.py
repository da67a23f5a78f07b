"""The answer of a query as a file, written whole or not at all."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TextIO

from semmap_log.arrow.arrow_sdk import pa, pq
from semmap_log.errors import FormatError
from semmap_log.io.disk import output_errors, whole_file
from semmap_log.queries.answer_rows import answer_rows, column_names, json_rows


def write_answer(answer: pa.Table, out: Path) -> None:
    """Write an answer to a file whose name tells its format.

    Raises:
        FormatError: It tells none.
        OutputError: It cannot be written; what was there is whole.
    """
    write = writer_for(out)
    with output_errors(out), whole_file(out) as temporary:
        write(answer, temporary)


def writer_for(out: Path) -> Callable[[pa.Table, Path], None]:
    """Return what writes an answer to a file of that name.

    Raises:
        FormatError: It tells no format.
    """
    write = _WRITERS.get(out.suffix.lower())
    if write is None:
        known = ", ".join(_WRITERS)
        raise FormatError(out, f"its name tells no format of an answer; known: {known}.")
    return write


def csv_lines(answer: pa.Table, file: TextIO) -> None:
    """Write an answer as CSV with a head: null is empty, a list or a map is JSON."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(column_names(answer))
    writer.writerows(map(_csv_row, answer_rows(answer)))


def _csv_row(row: Iterable[object]) -> list[object]:
    return [
        json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value
        for value in row
    ]


def _write_parquet(answer: pa.Table, path: Path) -> None:
    with path.open("wb") as file:
        pq.write_table(answer.rename_columns(column_names(answer)), file, compression="zstd")


def _write_csv(answer: pa.Table, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv_lines(answer, file)


def _write_json(answer: pa.Table, path: Path) -> None:
    with path.open("w", encoding="utf-8") as file:
        opening = "["
        for row in json_rows(answer):
            file.write(f"{opening}\n{json.dumps(row, ensure_ascii=False)}")
            opening = ","
        file.write("[]\n" if opening == "[" else "\n]\n")


_WRITERS: dict[str, Callable[[pa.Table, Path], None]] = {
    ".parquet": _write_parquet,
    ".csv": _write_csv,
    ".json": _write_json,
}
