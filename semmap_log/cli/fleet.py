"""`fleet`: one question to many logs."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, At, KnownAt, a_file, print_json, progress, say, size_of
from semmap_log.cli.fleet_answers import answer_to_json, print_answer, write_rows

if TYPE_CHECKING:
    from semmap_log.fleet.jobs.fleet_run import Fleet
    from semmap_log.fleet.jobs.job import FleetAnswer, FleetProgress, Tell

    Question = Callable[[Fleet, Tell], FleetAnswer]

ANY_BAD = 4
"""Exit code where a log gave no answer."""


class FleetJob(str, Enum):
    """The jobs, as typer wants its choices."""

    map = "map"
    openings = "openings"
    probabilities = "probabilities"
    verify = "verify"
    info = "info"
    export = "export"
    fold = "fold"


class EngineName(str, Enum):
    """The keys of `fleet.jobs.door_jobs.ENGINES`, as typer wants its choices."""

    dask = "dask"
    serial = "serial"


def run(
    job: Annotated[FleetJob, typer.Argument(metavar="JOB", help="What is asked: see above.")],
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOGS...",
            help="Logs, folders or prefixes of logs, patterns with *, or @FILE with one a line.",
        ),
    ],
    *,
    at: At = None,
    known_at: KnownAt = None,
    horizon: Annotated[
        str, typer.Option("--horizon", metavar="2h", help="probabilities: how long after it.")
    ] = "",
    estimator: Annotated[
        str | None,
        typer.Option("--estimator", metavar="NAME", help="probabilities: as that verb has it."),
    ] = None,
    fold: Annotated[
        str, typer.Option("--fold", metavar="MODULE:CLASS", help="fold: a projection of yours.")
    ] = "",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Write the rows as .parquet or .csv; export: a folder.",
            callback=a_file,
        ),
    ] = None,
    engine: Annotated[
        EngineName, typer.Option("--engine", help="dask, or serial: in this process.")
    ] = EngineName.dask,
    scheduler: Annotated[
        str,
        typer.Option(
            "--scheduler", metavar="ADDRESS", help="A cluster that runs; else this machine."
        ),
    ] = "",
    workers: Annotated[
        int | None, typer.Option("--workers", metavar="N", min=1, help="Of this machine.")
    ] = None,
    memory: Annotated[
        str, typer.Option("--memory", metavar="SIZE", help="Of each of them at most.")
    ] = "1GiB",
    timeout: Annotated[
        str,
        typer.Option("--timeout", metavar="1h", help="Give up if no worker answers for so long."),
    ] = "1h",
    results: Annotated[
        Path | None,
        typer.Option("--results", metavar="DIR", help="Keep answers there; default: a cache."),
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Ask every log, whatever was answered before.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Ask many logs one question, on all cores, or on a cluster that is there.

    \b
    Jobs:
      map            all doors of all logs at a moment (--at, --known-at)
      openings       how often each door was opened, by hour (UTC)
      probabilities  how likely each door is open (--at, --known-at, --horizon,
                     --estimator)
      info           what each log holds
      verify         whether each log is as it was written: reads every byte
      export         every event as Parquet files, a folder a month (--out)
      fold           what a projection of yours makes of each log (--fold)

    Each log's answer is kept until the log has grown: a run that was stopped resumes, and a
    repeated question reads new logs only. A log that is damaged, gone, refused, that kills its
    workers, or that has no answer in time (--timeout) is a row of its own; the others' answers
    stand.

    Exit code: 0 all logs answered, 1 the run failed, 2 usage, 4 some logs did not.

    \b
    Examples:
      semmap-log fleet map s3://hospital/logs --at 2026-03-02T10:30
      semmap-log fleet openings 's3://hospital/logs/tug*' --out openings.parquet
      semmap-log fleet verify logs/tug1 logs/tug2 --json
      semmap-log fleet export @logs.txt --out lake
      semmap-log fleet fold logs --fold mine:Openings --scheduler tcp://dask:8786
    """
    from semmap_log.fleet.jobs.fleet_run import fleet

    told = {"--at": at, "--known-at": known_at, "--horizon": horizon, "--estimator": estimator,
            "--fold": fold}  # fmt: skip
    question = _question(job, told, out)
    _check_out(job, out)
    many = fleet(
        logs, engine=engine.value, scheduler=scheduler, workers=workers, memory=memory,
        timeout_s=_seconds(timeout), results=results, fresh=fresh,
    )  # fmt: skip
    found = _asked(many, question)
    if out is not None and job is not FleetJob.export:
        write_rows(found, out)
    if as_json:
        print_json(answer_to_json(found))
    else:
        print_answer(found, out)
    if found.bad:
        raise typer.Exit(ANY_BAD)


_TAKES = {
    FleetJob.map: ("--at", "--known-at"),
    FleetJob.probabilities: ("--at", "--known-at", "--horizon", "--estimator"),
    FleetJob.fold: ("--fold",),
}
"""Job -> the options of the question that mean something to it."""


def _question(job: FleetJob, told: Mapping[str, Any], out: Path | None) -> Question:
    """Return what a command line asks of the logs."""
    from semmap_log.core.model.moments import parse_duration
    from semmap_log.fleet.jobs.job import projection_of

    for name, value in told.items():
        if value and name not in _TAKES.get(job, ()):
            raise typer.BadParameter(f"means nothing to {job.value}", param_hint=name)
    at, known_at, horizon = told["--at"], told["--known-at"], told["--horizon"]
    match job:
        case FleetJob.map:
            return lambda many, show: many.map(at, known_at, progress=show)
        case FleetJob.probabilities:
            ahead_ns = parse_duration(horizon) if horizon else 0
            return lambda many, show: many.probabilities(
                at, known_at, horizon_ns=ahead_ns, estimator=told["--estimator"], progress=show
            )
        case FleetJob.export:
            if out is None:
                raise typer.BadParameter("expected a folder or a URL", param_hint="--out")
            return lambda many, show: many.export(out, progress=show)
        case FleetJob.fold:
            if not told["--fold"]:
                raise typer.BadParameter("expected MODULE:CLASS", param_hint="--fold")
            projection = projection_of(told["--fold"])
            return lambda many, show: many.fold(projection, progress=show)
        case _:
            return lambda many, show: getattr(many, job.value)(progress=show)


def _seconds(timeout: str) -> float:
    from semmap_log.core.model.moments import parse_duration

    found = parse_duration(timeout) / 1e9
    if found <= 0:
        raise typer.BadParameter(f"expected more than 0, got {timeout}", param_hint="--timeout")
    return found


def _check_out(job: FleetJob, out: Path | None) -> None:
    if out is None or job is FleetJob.export:
        return
    if out.suffix not in (".parquet", ".csv"):
        raise typer.BadParameter(
            f"expected a name that ends in .parquet or .csv, got {out}", param_hint="--out"
        )


def _asked(many: Fleet, question: Question) -> FleetAnswer:
    from semmap_log.core.texts import counted
    from semmap_log.fleet.jobs.job import FleetProgress

    started, now = time.monotonic(), FleetProgress(0, len(many.places), 0, 0)

    def rates() -> str:
        each_s = now.events / max(time.monotonic() - started, 1e-3)
        return f"{counted(now.events, 'event')}, {each_s:,.0f}/s, {size_of(now.bytes)}"

    try:
        with progress("Asking", "logs", also=rates) as told:

            def show(here: FleetProgress) -> None:
                nonlocal now
                now = here
                if told is not None:
                    told(here.done, here.logs)

            found = question(many, show)
    except KeyboardInterrupt:
        had = f"{counted(now.done, 'log')} of {len(many.places):,} had answered"
        say(f"stopped: {had}. Finished answers are kept: run the command again to continue.")
        raise
    return found
