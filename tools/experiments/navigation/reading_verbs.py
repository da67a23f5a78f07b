"""The verbs of the experiment's program that read runs: tables, page, rerun."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from pathlib import Path

from navigation.records import START_NS
from navigation.run_verb import at_least_1
from navigation.runs import find_runs
from navigation.tables.experiment import tables_of
from navigation.tables.figures import RunFigures, figures_in
from navigation.tables.grouped import GroupedRuns
from navigation.tables.run_table import run_table
from navigation.tables.table import Table, csv_of
from navigation.tables.words import words_of
from semmap_log.core.io.disk import output_errors, replace_file

Verb = tuple[Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]


def _add_tables(parser: argparse.ArgumentParser) -> None:
    _take_runs(parser)
    parser.add_argument("--json", action="store_true", help="one document on stdout")
    parser.add_argument("--csv", type=Path, metavar="FOLDER", help="also write a file a table")


def _add_page(parser: argparse.ArgumentParser) -> None:
    _take_runs(parser)
    parser.add_argument("--to", type=Path, default=Path("experiment.html"), metavar="FILE",
                        help="default: %(default)s")  # fmt: skip
    parser.add_argument("--pictures", type=Path, metavar="FOLDER",
                        help="also write the histograms as .png")  # fmt: skip


def _add_rerun(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("run_folder", type=Path, metavar="RUN",
                        help="a run's folder, BUILDING/SETUP/SERIES-SEED")  # fmt: skip
    parser.add_argument("--to", type=Path, default=Path("run.rrd"), metavar="FILE",
                        help="default: %(default)s")  # fmt: skip
    parser.add_argument("--screenshot", type=Path, metavar="PNG",
                        help="also what the viewer shows; needs no screen")  # fmt: skip
    parser.add_argument("--at", type=float, metavar="SECOND",
                        help="second of the run in the screenshot; default: its end")  # fmt: skip


def _take_runs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("out", type=Path, nargs="+", help="folder of runs, as `run` makes them")
    parser.add_argument("--jobs", type=at_least_1, default=os.cpu_count() or 1, metavar="N",
                        help="processes that read; default: all cores")  # fmt: skip


def _tables(args: argparse.Namespace) -> int:
    """Print the tables, and what they mean."""
    runs = read_runs(args.out, jobs=args.jobs)
    tables = tables_of(runs)
    if args.csv is not None:
        _write_csv([*tables, run_table(runs)], args.csv)
    said = {building: words_of(runs, building) for building in runs.buildings}
    if args.json:
        every = [table.json() for table in [*tables, run_table(runs)]]
        print(json.dumps({"tables": every, "means": said}, indent=1, ensure_ascii=False))
        return 0
    print("\n".join(table.text() for table in tables))
    for building, sentences in said.items():
        print("\n- ".join([f"WHAT IT MEANS, {building}", *sentences]))
    return 0


def _page(args: argparse.Namespace) -> int:
    """Write the page, and its histograms beside it."""
    from navigation.page.page import page_of
    from navigation.page.picture_files import write_histograms

    runs = read_runs(args.out, jobs=args.jobs)
    _write(args.to, page_of(runs))
    if args.pictures is not None:
        write_histograms(runs, args.pictures)
    return 0


def _rerun(args: argparse.Namespace) -> int:
    """Write a recording of a run for rerun's viewer."""
    from navigation.page.run_recording import write_recording
    from navigation.runs import read_run
    from semmap_log.views.rerun.process import screenshot

    write_recording(read_run(args.run_folder), args.to)
    print(f"to look at it: rerun {args.to}", file=sys.stderr)
    if args.screenshot is not None:
        at_ns = None if args.at is None else START_NS + round(args.at * 1e9)
        screenshot(args.to, args.screenshot, at_ns=at_ns)
    return 0


def read_runs(folders: Sequence[Path], *, jobs: int = 1) -> GroupedRuns:
    """Return the figures of all runs in some folders, each read from its logs.

    Raises:
        RunError: There is none, or one is no run, or twice there.
        SemmapError: A log cannot be read.
    """
    found = [run for folder in folders for run in find_runs(folder)]
    return GroupedRuns(_figures(found, jobs))


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


def _write_csv(tables: Sequence[Table], folder: Path) -> None:
    """Write a file for each kind of table, all buildings and series in it."""

    def kind(table: Table) -> str:
        return table.name

    for name, some in groupby(sorted(tables, key=kind), kind):
        _write(folder / f"{name}.csv", csv_of(list(some)))


def _write(path: Path, text: str) -> None:
    with output_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, text.encode())


VERBS: dict[str, Verb] = {
    "tables": (_add_tables, _tables),
    "page": (_add_page, _page),
    "rerun": (_add_rerun, _rerun),
}
HELP = {
    "tables": "print the thesis's tables and ours, by replaying the logs",
    "page": "write all tables and pictures as one page",
    "rerun": "write a run as a recording for rerun's viewer",
}
