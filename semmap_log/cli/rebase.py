"""`rebase`: a level has a new map, and its doors their places in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import common

if TYPE_CHECKING:
    from semmap_log.core.folds.rebasing import MapFit, RebasePlan
    from semmap_log.core.model.rigid_transform import RigidTransform
    from semmap_log.interop.importing.rebase_files import RebaseMoment
    from semmap_log.log import About, DoorLog


@common.takes_about
def run(
    log: common.WritableLog,
    floor_map: Annotated[
        Path, typer.Argument(metavar="MAP.YAML", help="The new map, as map_server has it.")
    ],
    *,
    by: Annotated[
        str | None,
        typer.Option(
            "--by",
            metavar="DX,DY,THETA",
            help="From the old map to the new one: turn by THETA (radians), then shift (metres).",
        ),
    ] = None,
    pairs: Annotated[
        Path | None,
        typer.Option(
            "--pairs", metavar="CSV", help="Points in both maps, or doors in the new; see above."
        ),
    ] = None,
    most_residual: Annotated[
        float | None,
        typer.Option(
            "--most-residual", metavar="M", help="Refuse a pair that is farther off; default 0.3 m."
        ),
    ] = None,
    doors: Annotated[
        Path | None,
        typer.Option(
            "--doors",
            metavar="FILE",
            help="Doors that were measured in the new map: their places win over the transform.",
        ),
    ] = None,
    level: Annotated[
        str | None,
        typer.Option(help="Whose map it is, by number or name; needed if there are several."),
    ] = None,
    map_rules: Annotated[
        common.MapServer, typer.Option("--map-rules", help="As which map_server to read the map.")
    ] = common.MapServer.nav2,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only show what would be done; writes nothing.")
    ] = False,
    as_json: common.AsJson = False,
    about: About,
) -> None:
    """Give a level a new map, and move its doors into it, as one commit.

    Robots map a building again, and the new map has another origin and is turned. From now on, or
    --at, the level has the new floor plan, and each of its doors lies where the transform puts it.
    History stays: every earlier moment is drawn on the map of its time. Events at later
    times are taken to be in the new map already. The doors of other levels, and those without a
    place, stay as they are. `retract` of the commit's events brings the old map and places back.

    \b
    The transform, one of:
      --by DX,DY,THETA   x' = DX + cos(THETA) x - sin(THETA) y, y' likewise
      --pairs CSV        old_x,old_y,new_x,new_y[,name] of two or more points, in
                         metres, or door,new_x,new_y: where doors' lines start.
                         The best turn and shift (least squares, no scale); each
                         residual is shown, and a pair that spoils it is named.

    --doors takes the thesis's door database (by id) or an Open-RMF building (by name), in the frame
    of the new map: only the places of doors that the log has are read.

    \b
    Examples:
      semmap-log rebase office new.yaml --pairs points.csv --dry-run
      semmap-log rebase office new.yaml --pairs points.csv --reason "mapped again"
      semmap-log rebase office new.yaml --by 12.5,-3,1.5708 --at 2026-03-02T08:00
      semmap-log rebase office new.yaml --pairs points.csv --doors measured.yaml
      semmap-log rebase clinic L2.yaml --level L2 --by 0,0,3.1416 --json
    """
    from semmap_log.cli.door_options import tell
    from semmap_log.core.folds.rebasing import MOST_RESIDUAL_M
    from semmap_log.interop.formats.files.map_server import read_map
    from semmap_log.interop.formats.json.evaluation_json import rebase_to_json
    from semmap_log.log import DoorLogWriter, append, read

    _check_together(by, pairs, most_residual)
    most_m = MOST_RESIDUAL_M if most_residual is None else most_residual
    floor = read_map(floor_map, rules=map_rules.value)
    with read(log) if dry_run else append(log) as opened:
        moment = _moment(opened, level, about)
        fit, transform = _transform(moment, by, pairs, most_m, as_json=as_json)
        measured = moment.measured(doors)
        plan = moment.plan(floor, transform, measured)
        told = rebase_to_json(plan, fit, measured.strangers) if as_json else {}
        if not as_json:
            _show(plan, measured.strangers, dry_run=dry_run)
        if not isinstance(opened, DoorLogWriter):
            if as_json:
                common.print_json({"dry_run": True, **told})
            return
        appended = opened.rebase(
            plan.floor, by=plan.by, doors=dict(measured.doors.items()), level=plan.level, **about
        )
    tell(appended, as_json=as_json, **({"dry_run": False, **told} if as_json else {}))


def _check_together(by: str | None, pairs: Path | None, most_residual: float | None) -> None:
    """Refuse options that need others, or exclude them."""
    if (by is None) == (pairs is None):
        raise typer.BadParameter("give one of the two", param_hint="--by, --pairs")
    if most_residual is not None and pairs is None:
        raise typer.BadParameter("is about --pairs", param_hint="--most-residual")
    if most_residual is not None and not most_residual > 0:
        raise typer.BadParameter("expected metres, above 0", param_hint="--most-residual")


def _moment(log: DoorLog, level: str | None, about: About) -> RebaseMoment:
    """Return what the log holds when the new map comes; of a command sent again, as it was then."""
    from semmap_log.core.io.clock import SystemClock
    from semmap_log.core.model.moments import happened_ns_of
    from semmap_log.interop.importing.rebase_files import RebaseMoment
    from semmap_log.log import DoorLogWriter

    now_ns, before, command_id = SystemClock().wall_ns(), None, about.get("command_id")
    if isinstance(log, DoorLogWriter):
        now_ns = log.now_ns()
        known = None if command_id is None else log.find_command(command_id)
        before = None if known is None else known.first_event
    at_ns = happened_ns_of(about.get("at"), tz=log.info.timezone, now_ns=now_ns)
    return RebaseMoment.of(log, level, at_ns=at_ns, before_event=before)


def _transform(
    moment: RebaseMoment, by: str | None, pairs: Path | None, most_m: float, *, as_json: bool
) -> tuple[MapFit | None, RigidTransform]:
    """Return the transform, and how well the pairs fit it; what they say is shown before it counts.

    Raises:
        CommandError: A pair does not fit.
    """
    from semmap_log.core.folds.rebasing import check_fit
    from semmap_log.core.model.rigid_transform import RigidTransform
    from semmap_log.views.rebase_table import pairs_table

    if pairs is None:
        return None, RigidTransform.parse(by or "")
    fit = moment.fit(pairs, most_residual_m=most_m)
    if not as_json:
        common.console().print(pairs_table(fit))
    check_fit(fit, most_residual_m=most_m)
    for name in fit.misfits if not as_json else ():
        common.say(f"warning: {name} does not fit the others; without it the greatest residual is "
            f"{fit.without_misfits_m:.3f} m")  # fmt: skip
    for hint in fit.hints if not as_json else ():
        common.say(f"warning: {hint}")
    return fit, fit.transform


def _show(plan: RebasePlan, strangers: tuple[str, ...], *, dry_run: bool) -> None:
    from semmap_log.views.rebase_table import moved_doors_table, rebase_notes, rebase_warnings

    out = common.console()
    if plan.doors:
        out.print(moved_doors_table(plan))
    numbers = ",".join(f"{number:.6g}" for number in plan.by.as_list())
    height, width = plan.floor.cells.shape
    typer.echo(f"old map to new map: {numbers} (metres, metres, radians)")
    typer.echo(f"new map: {width} x {height} cells of {plan.floor.resolution:.3g} m")
    for note in rebase_notes(plan):
        typer.echo(note)
    for stranger in strangers:
        common.say(f"not on that level of the log, left out: {stranger}")
    for warning in rebase_warnings(plan):
        common.say(f"warning: {warning}")
    if dry_run:
        typer.echo("nothing was written (--dry-run)")
