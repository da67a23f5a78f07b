"""The sub-verb `run`: makes runs of the experiment."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import MISSING, Field, fields
from itertools import product
from pathlib import Path

from navigation.batch import run_all
from navigation.floors import Floor
from navigation.options import RunOptions
from navigation.running import RunTask
from navigation.setups import SETUPS
from navigation.streams import SERIES
from navigation.ways import planner

HELP = {
    "goals": "so many must be reached",
    "near_m": "the door sensor notices doors within this distance, m; several: a sweep",
    "notices": "P(the door sensor notices a difference), at each look",
    "sense_m": "range of the laser, m; several: a sweep",
    "noise_m": "standard deviation of a range, m",
    "clears_beyond": "a beam that meets nothing clears cells, too",
    "recovery_clears": "recovery forgets obstacles that are not near",
    "margin_m": "the local planner gives up before a goal with less room than this, m",
    "base": "base probability of a toggle; several: a sweep",
    "reading": "of the DoorDaemon's sentence: prose or literal; several: a sweep",
    "every_s": "between two iterations of the DoorDaemon, s",
    "rejected_within_s": "a goal given up later counts as given up after driving, s",
    "window": "setups that choose know so many goals at a time",
    "most_tries": "a run ends after so many goals, however few were reached",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Tell the parser what there is to say."""
    parser.add_argument("--building", type=Path, required=True, metavar="FILE",
                        help="an Open-RMF plan, *.building.yaml")  # fmt: skip
    parser.add_argument("--level", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--setup", nargs="+", choices=SETUPS, default=list(SETUPS), metavar="SETUP",
                        help=f"of {', '.join(SETUPS)}; default: all")  # fmt: skip
    parser.add_argument("--series", nargs="+", choices=SERIES, default=["fixed"],
                        help="fixed: setups share goals and doors; default: fixed")  # fmt: skip
    parser.add_argument("--seeds", type=seeds, default=range(1, 31), metavar="N or A..B",
                        help="N: 1..N; default: 30")  # fmt: skip
    parser.add_argument(
        "--jobs", type=at_least_1, default=1, help="processes; default: %(default)s"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the runs")
    for option in fields(RunOptions):
        _add_option(parser, option)


def _add_option(parser: argparse.ArgumentParser, option: Field[object]) -> None:
    flag, usual = f"--{option.name.replace('_', '-')}", option.default
    assert usual is not MISSING
    if isinstance(usual, bool):
        parser.add_argument(flag, action="store_true", help=HELP[option.name])
        return
    several = "sweep" in HELP[option.name]
    parser.add_argument(
        flag, type=type(usual), nargs="+" if several else None,
        default=[usual] if several else usual, metavar=type(usual).__name__.upper(),
        help=f"{HELP[option.name]}; default: {usual}",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Make what is asked for; 0: all is there.

    Raises:
        FormatError: The plan cannot be read.
        OptionError: A number that no run can be made with.
        MissingPlannerError: pyastar2d is not installed.
    """
    planner()
    Floor.read(args.building, args.level)  # before any process is started
    run_all(list(tasks_of(args)), args.out, args.jobs)
    return 0


def tasks_of(args: argparse.Namespace) -> Iterator[RunTask]:
    """Yield the runs, seed by seed, so that a part of them has all setups."""
    for options, series, seed in product(list(_options_of(args)), args.series, args.seeds):
        for setup in args.setup:
            yield RunTask(args.building, args.level, setup, series, seed, options)


def _options_of(args: argparse.Namespace) -> Iterator[RunOptions]:
    names = [option.name for option in fields(RunOptions)]
    given = [getattr(args, name) for name in names]
    for values in product(*(value if isinstance(value, list) else [value] for value in given)):
        yield RunOptions(**dict(zip(names, values, strict=True)))


def seeds(text: str) -> range:
    """Return the seeds that a text such as 30 or 5..8 means."""
    first, _, last = text.rpartition("..")
    try:
        found = range(int(first or 1), int(last) + 1)
    except ValueError:
        found = range(0)
    if not found or found[0] < 0:
        raise argparse.ArgumentTypeError(f"expected N or A..B, such as 30 or 5..8, got {text!r}")
    return found


def at_least_1(text: str) -> int:
    """Return the number."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected 1 or more, got {text!r}")
    return int(text)


Verb = tuple[Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]
RUN: Verb = (add_arguments, run)
