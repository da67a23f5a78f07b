"""`sql`: a query about one log, or several, in SQL."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, LogPath, a_file, console, print_json_list, say, size_of
from semmap_log.cli.sanitized_streams import steering
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.core.arrow.arrow_sdk import pa
    from semmap_log.log import DoorLog


def run(
    log: LogPath,
    query: Annotated[
        str | None,
        typer.Argument(metavar="QUERY", help="One SELECT; -: from standard input."),
    ] = None,
    *,
    file: Annotated[
        Path | None,
        typer.Option("--file", metavar="X.sql", help="The query is in this file."),
    ] = None,
    more: Annotated[
        list[str] | None,
        typer.Option("--log", metavar="NAME=LOG", help="One more log: NAME.events and so on."),
    ] = None,
    allow_files: Annotated[
        bool, typer.Option("--allow-files", help="The query may read files.")
    ] = False,
    limit: Annotated[
        int | None, typer.Option("--limit", metavar="N", min=1, help="So many rows at most.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Write the answer to a file: .parquet, .csv or .json.",
            callback=a_file,
        ),
    ] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="CSV, with a head.")] = False,
    as_json: AsJson = False,
) -> None:
    """Answer a query in SQL, by DuckDB. Without a query: show the views and their columns.

    Views: events, changes, doors, intervals, commits, patrols, poses. Of a moment:
    doors_at('2h ago'), doors_known_at('2h ago'), beliefs('now'). Times are instants; hour(happened)
    and the like count by the log's clocks. Nothing but --out is ever written, and a query reads no
    file without --allow-files. Needs semmap-log[sql].

    \b
    Examples:
      semmap-log sql office "from doors"
      semmap-log sql office "select door_name, count(*) from events group by all"
      semmap-log sql office "from doors_at('2h ago') where state = 'OPEN'" --json
      semmap-log sql office --file hours.sql --out hours.parquet
      semmap-log sql east --log west=west "select name from doors
        except select name from west.doors"
    """
    from semmap_log.analysis.sql.answer_rows import csv_lines, json_rows, write_answer, writer_for
    from semmap_log.analysis.sql.sql_query import table_of_query
    from semmap_log.core.io.disk import check_outside_log
    from semmap_log.log import read

    if as_csv and as_json:
        raise typer.BadParameter("expected one of --csv and --json, got both", param_hint="--csv")
    if out is not None:
        writer_for(out)  # a wrong name fails before the work
    text = _query(query, file)
    opened, others = read(log), _logs(more or [])
    for one in (opened, *others.values()):
        if out is not None:
            check_outside_log(one.path, out)
    if text is None:
        answer = _columns()
    else:
        wanted = None if limit is None else limit + 1
        answer = table_of_query(text, opened, others, allow_files=allow_files, limit=wanted)
    if limit is not None and answer.num_rows > limit:
        answer = answer.slice(0, limit)
        say(f"the first {counted(limit, 'row')}; there are more.")
    if out is not None:
        write_answer(answer, out)
        say(f"{out}: {counted(answer.num_rows, 'row')}, {size_of(out.stat().st_size)}")
    elif as_json:
        print_json_list(json_rows(answer))
    elif as_csv:
        csv_lines(answer, steering(sys.stdout))
    else:
        _show(answer, opened)


def _show(answer: pa.Table, log: DoorLog) -> None:
    from semmap_log.views.sql_answer_table import answer_pages

    printed = console()
    for page in answer_pages(answer, tz=log.info.timezone):
        printed.print(page)
    say(counted(answer.num_rows, "row"))


def _columns() -> pa.Table:
    """Return the views' columns, as the answer of a query about them."""
    from semmap_log.analysis.sql.sql_query import columns_table

    return columns_table()


def _query(query: str | None, file: Path | None) -> str | None:
    """Return the text of the query; None: there is none.

    Raises:
        FormatError: The file cannot be read.
        typer.BadParameter: There are two.
    """
    if query is not None and file is not None:
        raise typer.BadParameter("expected a query or a file of one, got both", param_hint="--file")
    if query != "-" and file is None:
        return query
    from semmap_log.errors import FormatError
    from semmap_log.interop.formats.parsing.foreign_file import MIB, decode_utf8, read_capped

    if file is None:
        text = sys.stdin.read(MIB + 1)
        if len(text) > MIB:
            problem = f"expected a query of at most {MIB:,} characters, got a longer one"
            raise FormatError("standard input", problem)
        return text
    return decode_utf8(read_capped(file, most_bytes=MIB), file)


def _logs(given: list[str]) -> dict[str, DoorLog]:
    """Return the logs of `NAME=LOG`.

    Raises:
        typer.BadParameter: One is not so written, or a name comes twice.
    """
    from semmap_log.log import read

    found: dict[str, DoorLog] = {}
    for text in given:
        name, equals, path = text.partition("=")
        if not equals or not path or name in found:
            raise typer.BadParameter(
                f"expected NAME=LOG, each name once, got {text!r}", param_hint="--log"
            )
        found[name] = read(path)
    return found
