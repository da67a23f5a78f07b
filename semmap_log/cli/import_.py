"""`import`: foreign files into the log."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli import bag_options, proposing
from semmap_log.cli.common import AsJson, MapServer, WritableLog, print_json, progress, say

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semmap_log.core.model.commits import Note
    from semmap_log.interop.importing.importing import ImportOptions
    from semmap_log.log import DoorLog


class Preset(str, Enum):
    """`semmap_log.interop.formats.files.door_table.PRESETS`, as typer wants its choices."""

    home_assistant = "home-assistant"
    zigbee2mqtt = "zigbee2mqtt"
    casas = "casas"


class Unit(str, Enum):
    """`TimeUnit`, as typer wants its choices."""

    s = "s"
    ms = "ms"
    us = "us"
    ns = "ns"


def run(
    log: WritableLog,
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="FILE", help="What to import.")
    ] = None,
    *,
    level: Annotated[
        str | None,
        typer.Option(
            help="By number or name. Building: only this level. Others: where their doors are, "
            "which level a map shows, where a bag's robot drove; needed if there are several."
        ),
    ] = None,
    preset: Annotated[
        Preset | None,
        typer.Option("--preset", help="A door log as another system writes it; see above."),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(
            "--columns",
            metavar="time=A,door=B,state=C",
            help="CSV: what the columns are called; accuracy=D, too.",
        ),
    ] = None,
    states: Annotated[
        str | None,
        typer.Option(
            "--states", metavar="WORD=STATE,…", help="CSV: what its words mean: on=open,off=closed."
        ),
    ] = None,
    time_unit: Annotated[
        Unit | None,
        typer.Option("--time-unit", help="CSV: of times that are numbers since 1970."),
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(
            "--accuracy",
            min=0.5,
            max=1,
            help="CSV: of rows without one, which are then sightings; else they set the state.",
        ),
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
        bool,
        typer.Option(
            "--update",
            help="Write what differs from a door that is there; bring removed ones back.",
        ),
    ] = False,
    renumber: Annotated[
        bool, typer.Option("--renumber", help="Give doors whose ids were removed new ids.")
    ] = False,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="TIME", help="When it happened, if the file does not say."),
    ] = None,
    since: Annotated[
        str | None,
        typer.Option(
            "--since", metavar="TIME", help="From then on the doors are there; see above."
        ),
    ] = None,
    since_ever: Annotated[
        bool,
        typer.Option("--since-ever", help="The same, before anything that the log tells."),
    ] = False,
    as_recorded: Annotated[
        bool,
        typer.Option("--as-recorded", help="The file's times are when it was known; see above."),
    ] = False,
    mapping: bag_options.MappingFile = None,
    scan: bag_options.Scan = None,
    pose_topic: bag_options.PoseTopic = None,
    heights: bag_options.Heights = None,
    keep_scans: bag_options.KeepScans = False,
    propose_doors: proposing.ProposeDoors = False,
    yes: proposing.Yes = False,
    only: proposing.Only = None,
    plot: proposing.Plot = None,
    map_rules: Annotated[
        MapServer | None,
        typer.Option("--map-rules", help="As which map_server to read a map; nav2."),
    ] = None,
    new_doors: Annotated[
        bool,
        typer.Option(
            "--new-doors", help="CSV: add doors that the log does not have, though it has others."
        ),
    ] = False,
    dry_run: bag_options.DryRun = False,
    source: Annotated[
        str,
        typer.Option(
            "--source",
            help="Which sensor it is of: only what the log has of that one is the same sighting.",
        ),
    ] = "",
    actor: Annotated[str, typer.Option("--actor", help="Who did it.")] = "",
    reason: Annotated[str, typer.Option("--reason", help="Why.")] = "",
    as_json: AsJson = False,
) -> None:
    """Import doors, states or events; each file is one commit, whole or not at all.

    The same file again, with the same options, changes nothing. A sighting that another file
    brought (same door, time, state and accuracy) counts once; for two sensors give each its
    --source. A file of which nothing can be imported is an error.

    JSON lines that `export` wrote become the commits that they were: numbers in retractions are
    those of this log, a command that is stored already is left alone, so that a log that grew
    brings only what is new. Recorded times are kept where the log holds nothing else; else they
    are now, and a line says why. All of the file is checked first; an import that was interrupted
    goes on where it stopped when it is called again. Of lines without a command_id those that
    follow each other and say the same of who and why are one commit.

    With --as-recorded the times of a file are also when it was known: a commit for each time. So
    --known-at also works for history that another program wrote. Nothing of the file may be
    earlier than the log's last commit: import old files first. Of a map or a building, --since
    says the time.

    \b
    Known by their keys:
      *.yaml             Open-RMF building (levels): doors, levels, walls as floor
                         plan; map_server map (image, resolution, origin), whose
                         picture lies next to it, as floor plan; else the thesis's
                         door database
    Known by their names:
      *.csv, *.csv.gz    timestamp,door,state[,accuracy], with , or ;
      *.jsonl, .jsonl.gz events as `export` writes and `record` takes them
      *.bag              bag of ROS 1
      *.mcap, *.db3      bag of ROS 2 (or ROS 1 in MCAP), or a folder of rosbag2

    A CSV that names a door which the log, having others, does not have is refused: correct the
    name, or add such doors with --new-doors. Door logs of other systems, whatever the files are
    called: --preset home-assistant (a downloaded history), zigbee2mqtt (its log, or mosquitto_sub
    -F '%I %t %p'), casas (date, time, sensor, value). Or say it yourself: --columns, --states,
    --time-unit, and by --only which doors.

    With --scan the laser of a robot sees the doors of the log, as they were then: each visit to a
    door that decides is a commit of its own, DoorObserved with an accuracy, or DoorPassed; the
    guide "Doors from a laser" explains more. TF has to lead from map to the laser. Doors that were
    added later than the scans were there by then with --since. --keep-scans keeps what the laser
    saw in LOG.scans, so that a person can check it: `view`, `scan-report --plot`.

    With --propose-doors nothing of the bag is imported: doors that the laser saw and the log does
    not have are listed, with what speaks for them, drawn with --plot, and added with --yes.

    A door is in the map from when it was added: now, or --at. Events of earlier times, such as last
    week's sightings, count in no answer. --since says that the doors of a building or a door
    database were there by then, also those that the log has already: their adding is retracted and
    recorded again, earlier. `history` shows both, and --known-at before that answers as it did.
    States stay of the time that they are from. Without FILE it is about the doors of which
    something is reported before they were added.

    \b
    Examples:
      semmap-log import office office.building.yaml
      semmap-log import office map.yaml --level L1
      semmap-log import lab doors.csv.gz --windows windows.csv --tz Europe/Oslo
      semmap-log import lab ha.csv --preset home-assistant --only '*door*'
      semmap-log import lab hub.csv --columns time=t,door=id,state=v
      semmap-log import lab 2025.csv --as-recorded
      semmap-log import office doors.yaml --update --reason "survey of May"
      semmap-log import office office.building.yaml --since 2026-01-01
      semmap-log import office --since-ever
      semmap-log import office monday.bag --mapping robot.yaml --dry-run | head
      semmap-log import office patrol.bag --scan
      semmap-log import office patrol.bag --scan --keep-scans
      semmap-log import office patrol --scan /front/scan --pose-topic /amcl_pose
      semmap-log import office patrol --scan /velodyne_points --heights 0.3,1.5
      semmap-log import office patrol.bag --scan --propose-doors --plot doors.png
      semmap-log import office patrol.bag --scan --propose-doors --yes --only 4
    """
    from semmap_log.analysis.scans.visit import scans_folder
    from semmap_log.core.model.commits import Note
    from semmap_log.interop.formats.files.door_table import form_of
    from semmap_log.interop.importing.importing import ImportOptions, import_file
    from semmap_log.interop.importing.present_log import backdate
    from semmap_log.interop.importing.scan_topics import ScanOptions
    from semmap_log.log import append, read

    files = files or []
    bag_options.check_scan(scan, pose_topic, heights)
    band = bag_options.heights_of(heights)
    bag_options.check_keep_scans(keep_scans=keep_scans, dry_run=dry_run)
    topics = None if scan is None else tuple(filter(None, scan))
    scans = None if topics is None else ScanOptions(topics, pose_topic or "", band)
    is_by_scans = scans is not None
    _check_together(files, since, since_ever=since_ever, dry_run=dry_run, by_scans=is_by_scans)
    numbers = proposing.numbers_of(only) if propose_doors else None
    form = form_of(
        preset=None if preset is None else preset.value, columns=columns, states=states,
        only=() if propose_doors else only or (),
        unit=None if time_unit is None else time_unit.value,
    )  # fmt: skip
    asked = proposing.Proposing(propose_doors, yes, numbers, plot)
    proposing.check_proposing(asked, has_scan=scan is not None, files=files, dry_run=dry_run)
    if propose_doors:
        options = ImportOptions(level=level, mapping=mapping, scan=scans)
        proposing.propose(
            log, files[0], options, asked, actor=actor, reason=reason, as_json=as_json
        )
        return

    def options_for(opened: DoorLog) -> ImportOptions:
        return ImportOptions(
            level=level, windows=windows, tz=tz, update=update, renumber=renumber,
            at_ns=_time_ns(opened, at, "--at"),
            since_ns=_since_ns(opened, since, since_ever=since_ever), mapping=mapping, scan=scans,
            map_rules=None if map_rules is None else map_rules.value, new_doors=new_doors,
            form=form, accuracy=accuracy, as_recorded=as_recorded,
        )  # fmt: skip

    note = Note(actor=actor, source=source, reason=reason)
    if dry_run:
        reader = read(log)
        _show(reader, files, options_for(reader), note)
        return
    results = []
    with append(log) as opened:
        options = options_for(opened)
        since_ns = options.since_ns
        if not files:
            moved = backdate(opened, since_ns or 0, note=note)
            results.append(_to_json(log, moved))
            if not as_json:
                _tell(log, moved)
        for file in files:
            with (
                _reporting_ctrl_c(file),
                progress(f"Importing {file.name}", unit="entries") as told,
            ):
                imported = import_file(
                    opened, file, options, note=note, keep_scans=keep_scans, progress=told
                )
            results.append(_to_json(file, imported))
            if not as_json:
                _tell(file, imported)
        if keep_scans and files and not as_json:
            say(f"{scans_folder(opened.path)}: the scans of visits.")
    if as_json:
        print_json(results)


_A_LASER = "(sensor_msgs/LaserScan)"
"""The end of the line about a topic that is left out."""

run.__doc__ = f"{run.__doc__}\n{bag_options.MAPPING_HELP}"


def _check_together(
    files: list[Path], since: str | None, *, since_ever: bool, dry_run: bool, by_scans: bool
) -> None:
    """Refuse options that need others, or exclude them."""
    if since is not None and since_ever:
        raise typer.BadParameter("give one of the two", param_hint="--since, --since-ever")
    is_dated = since is not None or since_ever
    if Path("-") in files:
        raise typer.BadParameter(
            "expected a file's name, got -; standard input is what `record` reads",
            param_hint="FILE",
        )
    if not files and not is_dated:
        raise typer.BadParameter("give at least one file", param_hint="FILE")
    if by_scans and since_ever:
        raise typer.BadParameter("of scans, say when: --since TIME", param_hint="--since-ever")
    if dry_run and not files:
        raise typer.BadParameter("shows what a file would bring", param_hint="--dry-run")


@contextmanager
def _reporting_ctrl_c(file: Path) -> Iterator[None]:
    """Say on Ctrl-C what became of a file."""
    try:
        yield
    except KeyboardInterrupt:
        say(f"{file}: interrupted; the same command goes on where it stopped.")
        raise


def _since_ns(log: DoorLog, since: str | None, *, since_ever: bool) -> int | None:
    """Return from when on doors are there, as given; None: no option was.

    Raises:
        MomentError: It is no time, or is to come.
    """
    from semmap_log.errors import MomentError
    from semmap_log.interop.importing.present_log import now_ns

    log_now_ns = now_ns(log)
    if since_ever:
        ever_ns = log.before_first_ns()
        if ever_ns is None:
            say(
                "--since-ever: the log has no events yet, so the doors exist from now on; "
                "give a time with --since, or repeat this after importing older events."
            )
            return log_now_ns
        return ever_ns
    since_ns = _time_ns(log, since, "--since", now_ns=log_now_ns)
    if since_ns is not None and since_ns > log_now_ns:
        raise MomentError(f"--since: expected a time up to now, got {since!r}.")
    return since_ns


def _time_ns(
    log: DoorLog, text: str | None, option: str, *, now_ns: int | None = None
) -> int | None:
    """Return the time of an option; None: it was not given.

    Raises:
        MomentError: It is an event's number, or cannot be read.
    """
    from semmap_log.errors import MomentError

    moment = log.moment(text, now_ns=now_ns)
    if moment.event is not None:
        raise MomentError(f"{option}: expected a time, got an event number.")
    return moment.ns


def _show(opened: DoorLog, files: list[Path], options: ImportOptions, note: Note) -> None:
    """Print the events that files would bring to the log as it is, one a line.

    Raises:
        FormatError: A file cannot be read, or nothing of it can be imported.
    """
    from semmap_log.interop.formats.bags.bag_reading import is_bag
    from semmap_log.interop.importing.importing import command_id_of, plan_file, plan_scan_import
    from semmap_log.interop.importing.line_commits import NumberMap

    options = replace(options, source=note.source)
    for file in files:
        if is_bag(file):
            with progress(f"Reading {file.name}", unit="messages") as told:
                found = plan_scan_import(opened, file, options, told, actor=note.actor)
            if found is not None:
                bag_options.print_scan_import(file, found)
                continue
        known = command_id_of(file, options)
        if any(commit.command_id == known for commit in opened.commits()):
            say(f"{file}: imported before; nothing would be made.")
            continue
        with progress(f"Reading {file.name}", unit="entries") as told:
            plan, lines = plan_file(opened, file, options, note=note, progress=told)
        if lines is not None:
            numbers = NumberMap()
            events = (
                each.event
                for commit in lines.commits()
                for each in commit.events(numbers, options.at_ns)
            )
            plan = replace(plan, events=events)
        bag_options.print_plan(file, plan)


def _tell(file: Path, imported: Any) -> None:
    from semmap_log.core.texts import counted, deduplicated

    plan = imported.plan
    if imported.known_before:
        holds_doors = file.suffix.lower() in {".yaml", ".yml"}
        more = " (--update writes what differs from it since)" if holds_doors else ""
        typer.echo(f"{file}: imported before; nothing to do{more}.")
        return
    if imported.first_event is None and file.is_dir() and not imported.plan.summary:
        typer.echo(f"{file}: no door has events from before it was added; nothing to do.")
    elif imported.first_event is None and plan.nothing:
        typer.echo(f"{file}: nothing was imported: {plan.nothing}.")
    elif imported.first_event is None:
        typer.echo(f"{file}: the log holds all of it already; nothing to do.")
    else:
        last = imported.first_event + plan.count - 1
        events = counted(plan.count, "event")
        typer.echo(f"{file}: {events}, numbers {imported.first_event}..{last}.")
    for text in plan.summary:
        typer.echo(f"  {text}")
    for text in deduplicated(plan.left_out):
        say(f"  left out: {text}")
    if any(text.endswith(_A_LASER) for text in plan.left_out):
        say("  with --scan a laser's scans tell how the doors stood")
    for text in deduplicated(plan.warnings):
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
