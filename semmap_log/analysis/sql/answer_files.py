"""The answer of a query as a file, written whole or not at all."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TextIO

from semmap_log.analysis.sql.answer_rows import answer_rows, column_names, json_rows, plain_values
from semmap_log.core.arrow.arrow_sdk import pa, pq
from semmap_log.core.io.disk import output_errors, whole_file
from semmap_log.errors import FormatError


def write_answer(answer: pa.Table, out: Path) -> None:
    """Write an answer to a file whose name tells its format.

    Raises:
        FormatError: It tells none.
        OutputError: It cannot be written; what was there is whole.
    """
    write = writer_for(out)
    try:
        with output_errors(out), whole_file(out) as temporary:
            write(answer, temporary)
    except (pa.ArrowNotImplementedError, pa.ArrowInvalid) as error:
        raise FormatError(out, f"{error}; write it as .csv or .json.") from None


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
    columns = [_storable(answer.column(place)) for place in range(answer.num_columns)]
    table = pa.Table.from_arrays(columns, names=column_names(answer))
    with path.open("wb") as file:
        pq.write_table(table, file, compression="zstd")


def _storable(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return a column as Parquet can have it: spans of time as text, as in the other files."""
    if column.type != pa.month_day_nano_interval():
        return column
    return pa.chunked_array([pa.array(plain_values(column), pa.string())])


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
