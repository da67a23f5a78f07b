"""The verbs of the experiment's program that read runs: tables, page, rerun."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from pathlib import Path
from typing import Any

from navigation.runs import find_runs
from navigation.tables.experiment import tables_of
from navigation.tables.figures import RunFigures, figures_in
from navigation.tables.grouped import GroupedRuns
from navigation.tables.run_table import run_table
from navigation.tables.table import Table, csv_of


def add_to(verbs: Any) -> None:
    """Add the verbs to a parser's subparsers; each sets `run`, which returns the exit code."""
    tables = verbs.add_parser(
        "tables", help="print the thesis's tables, and ours", description=print_tables.__doc__
    )
    _take_runs(tables)
    tables.add_argument("--json", action="store_true", help="one document on stdout")
    tables.add_argument("--csv", type=Path, metavar="FOLDER", help="also write a file a table")
    tables.set_defaults(run=print_tables)


def _take_runs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("out", type=Path, nargs="+", help="folder of runs, as `run` makes them")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count(), help="processes that read; default: all cores"
    )


def print_tables(args: argparse.Namespace) -> int:
    """Print the tables, made by replaying the logs of all runs in the folders."""
    runs = read_runs(args.out, jobs=args.jobs)
    tables = tables_of(runs)
    if args.csv is not None:
        write_csv([*tables, run_table(runs)], args.csv)
    if args.json:
        every = [table.json() for table in [*tables, run_table(runs)]]
        print(json.dumps({"tables": every}, indent=1, ensure_ascii=False))
    else:
        print("\n".join(table.text() for table in tables), end="")
    return 0


def read_runs(folders: Sequence[Path], *, jobs: int | None = 1) -> GroupedRuns:
    """Return the figures of all runs in some folders, each read from its logs.

    Raises:
        RunError: There is none, or one is no run, or twice there.
        SemmapError: A log cannot be read.
    """
    found = [run for folder in folders for run in find_runs(folder)]
    return GroupedRuns(list(_figures(found, jobs or 1)))


def _figures(folders: Sequence[Path], jobs: int) -> list[RunFigures]:
    if jobs == 1 or len(folders) < 2 * jobs:
        return [figures_in(folder) for folder in folders]
    with ProcessPoolExecutor(jobs) as pool:
        every = []
        for done in pool.map(figures_in, folders, chunksize=4):
            every.append(done)
            if sys.stderr.isatty():
                end = "\n" if len(every) == len(folders) else ""
                print(f"\rread {len(every)} of {len(folders)} runs", end=end, file=sys.stderr)
        return every


def write_csv(tables: Sequence[Table], folder: Path) -> None:
    """Write a file for each kind of table, all buildings and series in it."""
    folder.mkdir(parents=True, exist_ok=True)

    def kind(table: Table) -> str:
        return table.name

    for name, some in groupby(sorted(tables, key=kind), kind):
        (folder / f"{name}.csv").write_text(csv_of(list(some)), encoding="utf-8")
