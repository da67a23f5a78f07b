"""`evaluate`: how good the forecasts are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import common

if TYPE_CHECKING:
    from semmap_log.analysis.beliefs.protocol import Patrol


def run(
    log: common.LogPath,
    *,
    split: Annotated[
        float, typer.Option("--split", metavar="SHARE", help="Of the known time: what teaches.")
    ] = 0.7,
    prequential: Annotated[
        bool, typer.Option("--prequential", help="Learn on: each day that is over, at midnight.")
    ] = False,
    horizon: Annotated[
        str | None,
        typer.Option("--horizon", metavar="1h", help="All is known up to so long before."),
    ] = None,
    patrol: Annotated[
        str | None,
        typer.Option("--patrol", metavar="30m", help="Known is only what visits so often read."),
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option("--accuracy", help="Of --patrol: P(it reads right), 0.5..1; 0.9."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", help="Of --patrol: of its errors; 0.", min=0)
    ] = None,
    step: Annotated[
        float, typer.Option("--step", metavar="S", help="Seconds between two forecasts.")
    ] = 60.0,
    estimator: Annotated[
        list[str] | None,
        typer.Option("--estimator", metavar="NAME", help="Repeatable; default: all; or fremen1."),
    ] = None,
    door: Annotated[
        list[str] | None,
        typer.Option("--door", metavar="DOOR", help="Only this one; repeatable."),
    ] = None,
    since: common.Since = None,
    until: common.Until = None,
    tz: Annotated[
        str | None, typer.Option("--tz", metavar="ZONE", help="The building's clocks; the log's.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="X.png", help="Draw the reliability diagram; or .svg."),
    ] = None,
    as_json: common.AsJson = False,
) -> None:
    """Show how good forecasts of the doors are: the first part teaches, the rest is forecast.

    Where the log knows states all through (updates, contacts), they are the truth. Where it holds
    sightings there is none: then the reading of each next visit is forecast. Figures: Brier score
    and log-loss (less is better, 0 is perfect), ECE (how far forecasts are from frequencies),
    bias (above 0: forecast to be open too often).

    \b
    Examples:
      semmap-log evaluate office
      semmap-log evaluate office --prequential --plot calibration.png
      semmap-log evaluate office --horizon 1h --estimator filter --estimator last
      semmap-log evaluate lab --patrol 30m --accuracy 0.9 --seed 7 --json
    """
    from semmap_log.analysis.beliefs.evaluation import evaluate
    from semmap_log.analysis.beliefs.protocol import Protocol
    from semmap_log.analysis.probabilities.belief_fold import ESTIMATORS, by_name
    from semmap_log.core.io.disk import check_outside_log, log_name
    from semmap_log.core.model.moments import parse_duration
    from semmap_log.interop.formats.json.evaluation_json import evaluation_to_json
    from semmap_log.log import read
    from semmap_log.views.timeline_table import evaluation_table

    protocol = Protocol(
        split, prequential, None if horizon is None else parse_duration(horizon),
        _patrol(patrol, accuracy, seed), step,
    )  # fmt: skip
    methods = [by_name(name) for name in dict.fromkeys(estimator or ESTIMATORS)]
    opened = read(log)
    if plot is not None:
        check_outside_log(opened.path, plot)
    start, end = common.range_of(opened, since, until)
    with common.progress("Forecasting", unit="forecasts") as told:
        found = evaluate(
            opened, methods, protocol, since=start, until=end, tz=tz, progress=told,
            doors=[opened.resolve_any_door(name) for name in door] if door else None,
        )  # fmt: skip
    if plot is not None:
        from semmap_log.views.plots.calibration import plot_calibration

        plot_calibration(found, plot, name=log_name(log))
    if found.protocol.step_s != step:
        common.say(
            f"known for so long: a forecast each {found.protocol.step_s:g} s, not each {step:g} s."
        )
    names = opened.door_names()
    if as_json:
        common.print_json(evaluation_to_json(found, names=names))
    else:
        common.console().print(evaluation_table(found, names=names))
        if plot is not None:
            common.say(f"{plot}: the reliability diagram.")


def _patrol(every: str | None, accuracy: float | None, seed: int | None) -> Patrol | None:
    from semmap_log.analysis.beliefs.protocol import Patrol
    from semmap_log.core.model.moments import parse_duration

    if every is None:
        given = [name for name, v in (("--accuracy", accuracy), ("--seed", seed)) if v is not None]
        if given:
            raise typer.BadParameter("of a --patrol, which is not given", param_hint=given[0])
        return None
    return Patrol(parse_duration(every), 0.9 if accuracy is None else accuracy, seed or 0)
