r"""Evaluate our estimators, and the published ones, on sets of real doors.

    python tools/experiments/eval_doors.py ../shared/data/doors/*/
    python tools/experiments/eval_doors.py workshop home \
        --tz workshop=Europe/Oslo --tz home=Europe/Amsterdam
    python tools/experiments/eval_doors.py FOLDER --json > scores.json
    python tools/experiments/eval_doors.py FOLDER \
        --peer chained="python tools/experiments/door_peers/chained.py"

A FOLDER holds doors.csv.gz (timestamp,door,state: a row a change) and obs_windows.csv
(door,start,end: when the state is known at all); its name is the set's. Each is imported into a log
of its own. The first 70 % of each door's known time teaches, the rest is forecast; figures are
means over doors.

frozen: known is what was known at the split; daily: at the midnight before; lag_1h, lag_6h,
lag_24h: so long before; patrol_30m, patrol_4h: only what a visit so often read, right 90 % of the
time. What it misreads is drawn anew with each of the seeds; figures are means over them.

Differences: the estimator under test is held against each other one on the same forecasts (and the
same seeds), with a standard error, and an interval from a bootstrap that draws days. The same
command gives the same figures.

Zones: times in the files are wall clocks. Without --tz they are taken as they stand (UTC): hours
and weekdays are the building's; only the hours that daylight saving time skips or repeats are not
seen.

Steps: a forecast each 60 s. Where all times stand on whole multiples of more than a minute, the
set was polled, and every second multiple is enough: polled each 5 minutes, forecast each 10, but no
less often.
"""

from __future__ import annotations

import argparse
import json
import math
import shlex
import sys
import tempfile
import time
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from door_eval.day_losses import LossBook
from door_eval.mode_scores import ModeScores
from door_eval.peers import Peer
from door_eval.tables import SetScores, legend, print_tables

import semmap_log as sl
from semmap_log.analysis.beliefs.evaluation import evaluate, evaluate_all
from semmap_log.analysis.beliefs.protocol import Patrol, Protocol
from semmap_log.analysis.probabilities.belief_fold import by_name
from semmap_log.analysis.probabilities.estimator import Estimator
from semmap_log.analysis.probabilities.methods.baselines import CONSTANT
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.errors import FormatError, SemmapError
from semmap_log.interop.formats.files.csv_windows import read_windows
from semmap_log.interop.formats.files.door_csv import read_door_csv
from semmap_log.interop.importing.importing import ImportOptions, import_file

ESTIMATORS = (
    "count", "schedule", "filter", "fremen5", "last", "constant", "hour_of_day", "hour_of_week",
)  # fmt: skip
MORE_FREMEN = ("fremen1", "fremen2", "fremen3", "fremen4")
"""Shown to people, too."""
HOUR_NS = 3600 * SECOND_NS
LAGS_H = (1, 6, 24)
PATROLS = {"patrol_30m": HOUR_NS // 2, "patrol_4h": 4 * HOUR_NS}
MODES = ("frozen", "daily", *(f"lag_{h}h" for h in LAGS_H), *PATROLS)
STEP_S, MOST_STEP_S = 60.0, 600.0
FIGURES = ("brier", "log_loss", "ece", "bias")

UNDER_TEST = "filter"
"""Which estimator is held against the others, unless another is named."""

Modes = Mapping[str, Sequence[Protocol]]
"""Mode -> its protocols: one, or one a seed."""


def main() -> int:
    options = _options()
    try:
        zones = _zones(options.tz, [_name(folder) for folder in options.folders])
        with ExitStack() as running:
            methods = _methods(options, running)
            _under_test(options)
            found = {
                _name(folder): _evaluated(folder, options, zones, methods)
                for folder in options.folders
            }
    except SemmapError as error:
        print(f"eval_doors: {error}", file=sys.stderr)
        return 1
    if options.details:
        options.details.write_text(json.dumps(_details(found, options), indent=2) + "\n")
    if options.json:
        print(json.dumps(_document(found), indent=2))
    else:
        _print(found, options)
    return 0


@dataclass(frozen=True)
class _Set:
    """The files of a set."""

    doors: Path
    windows: Path

    @classmethod
    def of(cls, folder: Path) -> _Set:
        """Return the files of a folder.

        Raises:
            FormatError: They are not there.
        """
        doors = [path for path in (folder / "doors.csv.gz", folder / "doors.csv") if path.exists()]
        windows = folder / "obs_windows.csv"
        if not doors or not windows.exists():
            raise FormatError(folder, "expected a folder with doors.csv.gz and obs_windows.csv")
        return cls(doors[0], windows)


def _evaluated(
    folder: Path,
    options: argparse.Namespace,
    zones: Mapping[str, str],
    methods: Sequence[Estimator],
) -> SetScores:
    """Import a set into a log, and return what all modes make of it."""
    begin, name = time.monotonic(), _name(folder)
    files, tz = _Set.of(folder), zones.get(name, zones[""])
    step_s = options.step or step_of(files)
    with tempfile.TemporaryDirectory(prefix="eval_doors_") as room:
        log = _log_of(files, Path(room, name), tz)
        tell = _Telling(name)
        enough = evaluate(log, [CONSTANT], Protocol(step_s=step_s)).doors
        doors = [door.door_id for door in enough][: options.doors]
        patrolled = doors[: options.patrol_doors]
        found = _scored(log, methods, _known(step_s, options), doors, tell)
        found |= _scored(log, methods, _visited(step_s, options), patrolled, tell)
    said = f"{len(doors)} doors, {len(patrolled)} patrolled, a step of {step_s:g} s"
    print(f"\r{name}: {said}, {tz}: {time.monotonic() - begin:.0f} s", file=sys.stderr)
    return found


def _log_of(files: _Set, path: Path, tz: str) -> sl.DoorLog:
    with sl.create(path, tz=tz, durability="none") as log:
        import_file(log, files.doors, ImportOptions(windows=files.windows))
    return sl.read(path)


def _scored(
    log: sl.DoorLog, methods: Sequence[Estimator], modes: Modes, doors: Collection[DoorId],
    tell: Progress,
) -> dict[str, ModeScores]:  # fmt: skip
    """Return the scores of each mode, having learnt once for all that have the same evidence."""
    keys = {mode: [f"{mode} {n}" for n in range(len(same))] for mode, same in modes.items()}
    protocols = {
        key: protocol
        for mode, same in modes.items()
        for key, protocol in zip(keys[mode], same, strict=True)
    }
    book = LossBook(LocalClock(log.info.timezone))
    evaluations = evaluate_all(
        log, methods, protocols, doors=doors, progress=tell, read_forecasts=book
    )
    return {
        mode: ModeScores(
            [evaluations[key] for key in keys[mode]],
            {one.name: [book.losses[key, one.name] for key in keys[mode]] for one in methods},
        )
        for mode in modes
    }


def _known(step_s: float, options: argparse.Namespace) -> Modes:
    """Return the modes in which states are known up to some time."""
    lags = {f"lag_{h}h": [Protocol(horizon_ns=h * HOUR_NS, step_s=step_s)] for h in LAGS_H}
    frozen, daily = Protocol(step_s=step_s), Protocol(prequential=True, step_s=step_s)
    return _asked({"frozen": [frozen], "daily": [daily], **lags}, options)


def _visited(step_s: float, options: argparse.Namespace) -> Modes:
    """Return the modes in which a robot with a noisy sensor passes by: a protocol a seed."""
    seeds = _seeds(options)
    modes = {
        mode: [
            Protocol(patrol=Patrol(every_ns, options.accuracy, seed), step_s=step_s)
            for seed in seeds
        ]
        for mode, every_ns in PATROLS.items()
    }
    return _asked(modes, options)


def _seeds(options: argparse.Namespace) -> range:
    return range(options.seed, options.seed + options.seeds)


def _asked(modes: Modes, options: argparse.Namespace) -> Modes:
    return {mode: same for mode, same in modes.items() if not options.mode or mode in options.mode}


def step_of(files: _Set) -> float:
    """Return how far apart forecasts are, seconds: by the times in a set's files."""
    times = [read_door_csv(files.doors, tz="UTC").happened_ns.tolist()]
    for windows in read_windows(files.windows, tz="UTC").values():
        times += [[window.start_ns, window.end_ns] for window in windows]
    polled_s = math.gcd(*(ns for some in times for ns in some)) / SECOND_NS
    return min(2 * polled_s, MOST_STEP_S) if polled_s > STEP_S else STEP_S


def _methods(options: argparse.Namespace, running: ExitStack) -> Sequence[Estimator]:
    """Return the estimators, ours and peers; these run until the stack is left.

    Raises:
        FormatError: A peer has no name, or that of an estimator.
        EstimatorError: There is no such estimator, or a peer cannot be started.
    """
    ours, peers = _ours(options), _peers(options)
    return [
        *map(by_name, ours),
        *(running.enter_context(Peer(name, command)) for name, command in peers.items()),
    ]


def _names(options: argparse.Namespace) -> list[str]:
    return [*_ours(options), *_peers(options)]


def _ours(options: argparse.Namespace) -> Sequence[str]:
    if options.estimator:
        return list(dict.fromkeys(options.estimator))
    return ESTIMATORS if options.json else (*ESTIMATORS, *MORE_FREMEN)


def _peers(options: argparse.Namespace) -> dict[str, str]:
    """Return name -> command of each peer."""
    found: dict[str, str] = {}
    for text in options.peer:
        name, equals, command = text.partition("=")
        if not equals or not name or name in found or name in _ours(options):
            raise FormatError(
                "--peer", f"expected NAME=PROGRAM with a name of its own, got {text!r}"
            )
        found[name] = command
    return found


class _Telling:
    """Says on a terminal how far the work on a set is."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._last_s = 0.0

    def __call__(self, done: int, total: int) -> None:
        if sys.stderr.isatty() and time.monotonic() - self._last_s > 0.2:
            self._last_s = time.monotonic()
            print(f"\r{self._name}: {done}/{total} forecasts of a door ", end="", file=sys.stderr)


def _print(found: Mapping[str, SetScores], options: argparse.Namespace) -> None:
    """Print when and how, and the tables."""
    seeds = _seeds(options)
    print(f"{datetime.now(timezone.utc):%Y-%m-%d}, {legend(options.figure, seeds)}; by:")
    print(f"`{shlex.join(['python', 'tools/experiments/eval_doors.py', *sys.argv[1:]])}`\n")
    print_tables(found, _names(options), options.figure, _under_test(options))


def _document(found: Mapping[str, SetScores]) -> dict[str, Any]:
    """Return set -> mode -> estimator -> figure -> value."""
    return {
        name: {mode: scores.figures for mode, scores in modes.items()}
        for name, modes in found.items()
    }


def _details(found: Mapping[str, SetScores], options: argparse.Namespace) -> dict[str, Any]:
    ours = _under_test(options)
    return {
        name: {mode: scores.details(ours) for mode, scores in modes.items()}
        for name, modes in found.items()
    }


def _under_test(options: argparse.Namespace) -> str:
    """Return which estimator is held against each other one.

    Raises:
        FormatError: It is none of them.
    """
    names = _names(options)
    ours: str = options.under_test or (UNDER_TEST if UNDER_TEST in names else names[0])
    if ours not in names:
        raise FormatError("--under-test", f"expected one of {', '.join(names)}, got {ours!r}")
    return ours


def _name(folder: Path) -> str:
    return folder.resolve().name


def _zones(given: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Return the zone of each set, and under "" that of the others.

    Raises:
        FormatError: Two folders have the same name, or a zone is of none.
    """
    if len(set(names)) < len(names):
        raise FormatError("FOLDER", f"expected different names, got {', '.join(sorted(names))}")
    zones = {"": "UTC"}
    for text in given:
        name, equals, tz = text.rpartition("=")
        if equals and name not in names:
            raise FormatError("--tz", f"expected one of {', '.join(names)}, got {name!r}")
        zones[name] = tz
    return zones


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", metavar="FOLDER", type=Path, nargs="+", help="a set of doors")
    parser.add_argument("--json", action="store_true", help="one document instead of tables")
    parser.add_argument(
        "--tz", metavar="[NAME=]ZONE", action="append", default=[],
        help="zone of a set's times, or of all; repeatable; default: UTC",
    )  # fmt: skip
    parser.add_argument("--step", metavar="S", type=float, help="seconds between two forecasts")
    parser.add_argument("--estimator", metavar="NAME", action="append", help="repeatable")
    parser.add_argument(
        "--peer", metavar="NAME=PROGRAM", action="append", default=[],
        help="a program that forecasts, too (see tools/experiments/door_peers); repeatable",
    )  # fmt: skip
    parser.add_argument("--figure", choices=FIGURES, default="brier", help="which the tables show")
    parser.add_argument(
        "--under-test", metavar="NAME", help="held against each other one; filter, or the first"
    )
    parser.add_argument(
        "--mode", metavar="NAME", action="append", choices=MODES, help="repeatable; default: all"
    )
    parser.add_argument("--seed", type=int, default=0, help="first of the patrols' errors; 0")
    parser.add_argument(
        "--seeds", metavar="N", type=_at_least_1, default=8, help="so many of them; 8"
    )
    parser.add_argument(
        "--details", metavar="FILE", type=Path,
        help="write a JSON document with each seed's figures, standard errors, and differences",
    )  # fmt: skip
    parser.add_argument("--accuracy", type=float, default=0.9, help="of the patrols; 0.9")
    parser.add_argument(
        "--doors", metavar="N", type=_at_least_1,
        help="only so many doors of a set, those that the file names first",
    )  # fmt: skip
    parser.add_argument(
        "--patrol-doors", metavar="N", type=int, default=40,
        help="so many doors of a set are patrolled, those that the file names first; 40",
    )  # fmt: skip
    return parser.parse_args()


def _at_least_1(text: str) -> int:
    count = int(text)
    if count < 1:
        raise argparse.ArgumentTypeError(f"expected 1 or more, got {text}")
    return count


if __name__ == "__main__":
    sys.exit(main())
