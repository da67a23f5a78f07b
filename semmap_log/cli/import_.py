"""`import`: foreign files into the log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from semmap_log.cli.common import AsJson, LogPath, print_json, progress, say
from semmap_log.cli.mapping import MAPPING_HELP, DryRun, MappingFile, tell_plan


def run(
    log: LogPath,
    files: Annotated[list[Path], typer.Argument(metavar="FILE", help="What to import.")],
    *,
    level: Annotated[
        str | None,
        typer.Option(help="Building: only this level. Others: the level of their doors."),
    ] = None,
    windows: Annotated[
        Path | None,
        typer.Option(
            "--windows",
            metavar="CSV",
            help="For a door CSV: door,start,end, when its state is known at all.",
        ),
    ] = None,
    tz: Annotated[
        str | None,
        typer.Option(
            "--tz", metavar="ZONE", help="Zone of times without an offset; default: the log's."
        ),
    ] = None,
    update: Annotated[
        bool, typer.Option("--update", help="Write values that differ from a door that is there.")
    ] = False,
    renumber: Annotated[
        bool, typer.Option("--renumber", help="Give doors whose ids were removed new ids.")
    ] = False,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="TIME", help="When it happened, if the file does not say."),
    ] = None,
    mapping: MappingFile = None,
    dry_run: DryRun = False,
    actor: Annotated[str, typer.Option("--actor", help="Who did it.")] = "",
    reason: Annotated[str, typer.Option("--reason", help="Why.")] = "",
    as_json: AsJson = False,
) -> None:
    """Import doors, states or events; each file is one commit, whole or not at all.

    The same file again, with the same options, changes nothing.

    \b
    Known by their names:
      *.building.yaml    Open-RMF building: doors, levels, walls as floor plan
      *.yaml             the thesis's door database
      *.csv, *.csv.gz    timestamp,door,state[,accuracy]
      *.jsonl, .jsonl.gz events as `record` takes them
      *.bag              bag of ROS 1
      *.mcap, *.db3      bag of ROS 2 (or ROS 1 in MCAP), or a folder of rosbag2

    \b
    Examples:
      semmap-log import office office.building.yaml
      semmap-log import lab doors.csv.gz --windows obs_windows.csv --tz Europe/Oslo
      semmap-log import office doors.yaml --update --reason "survey of May"
      semmap-log import office monday.bag --mapping robot.yaml --dry-run | head
    """
    import semmap_log as sl
    from semmap_log.importing import ImportOptions, import_file

    if dry_run:
        _show(log, files, ImportOptions(mapping=mapping))
        return
    results = []
    with sl.append(log) as opened:
        at_ns = opened.moment(at).ns
        options = ImportOptions(level, windows, tz, update, renumber, at_ns, mapping)
        note = sl.Note(actor=actor, reason=reason)
        for file in files:
            with progress(f"Importing {file.name}", unit="entries") as told:
                imported = import_file(opened, file, options, note=note, progress=told)
            results.append(_to_json(file, imported))
            if not as_json:
                _tell(file, imported)
    if as_json:
        print_json(results)


run.__doc__ = f"{run.__doc__}\n{MAPPING_HELP}"


def _show(log: Path, files: list[Path], options: Any) -> None:
    """Print the events that bags would bring to the log as it is, one a line.

    Raises:
        FormatError: A file is no bag, or cannot be read.
    """
    import semmap_log as sl
    from semmap_log.errors import FormatError
    from semmap_log.formats.bag_reading import is_bag
    from semmap_log.importing import command_id_of, plan_bag_import

    opened = sl.read(log)
    for file in files:
        if not is_bag(file):
            raise FormatError(file, "--dry-run shows what a bag would bring; this is none")
        known = command_id_of(file, options)
        if any(commit.command_id == known for commit in opened.commits()):
            say(f"{file}: imported before; nothing would be made.")
            continue
        with progress(f"Reading {file.name}", unit="messages") as told:
            plan = plan_bag_import(opened, file, options, told)
        tell_plan(file, plan)


def _tell(file: Path, imported: Any) -> None:
    from semmap_log.repeats import told_once

    plan = imported.plan
    if imported.known_before:
        typer.echo(f"{file}: imported before; nothing to do.")
        return
    if imported.first_event is None:
        typer.echo(f"{file}: the log holds all of it already; nothing to do.")
    else:
        last = imported.first_event + plan.count - 1
        typer.echo(f"{file}: {plan.count} events, numbers {imported.first_event}..{last}.")
    for text in plan.summary:
        typer.echo(f"  {text}")
    for text in told_once(plan.left_out):
        say(f"  left out: {text}")
    for text in told_once(plan.warnings):
        say(f"  warning: {text}")


def _to_json(file: Path, imported: Any) -> dict[str, Any]:
    plan = imported.plan
    return {
        "file": str(file),
        "event": imported.first_event,
        "count": plan.count if imported.first_event is not None else 0,
        "known_before": imported.known_before,
        "summary": list(plan.summary),
        "left_out": list(plan.left_out),
        "warnings": list(plan.warnings),
    }
