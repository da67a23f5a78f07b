"""`scan-report`: how a laser saw the doors, and how far to trust it.

It has what the verbs share that read ROS messages: the mapping's option, its help, the dry run.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import (
    AsJson,
    LogPath,
    PaletteChoice,
    PaletteName,
    Since,
    Until,
    console,
    print_json,
    progress,
    range_of,
    say,
    tell_how_to_begin,
)
from semmap_log.cli.plain_streams import json_text
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from collections.abc import Iterable

    from semmap_log.analysis.scans.door_figures import ScanReport
    from semmap_log.core.batches.event_batch import EventBatch
    from semmap_log.core.model.commits import Note
    from semmap_log.core.model.events import Event
    from semmap_log.interop.importing.import_plan import ImportPlan
    from semmap_log.interop.importing.scan_reporting import SeenVisits
    from semmap_log.interop.importing.scan_topics import ScanImport
    from semmap_log.views.palette import Palette


MappingFile = Annotated[
    Path | None,
    typer.Option(
        "--mapping", metavar="YAML", help="Which ROS topics are read, and how; see above."
    ),
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Print the events, a JSON line each; write nothing.")
]

Scan = Annotated[
    list[str] | None,
    typer.Option(
        "--scan",
        metavar="[TOPIC]",
        help="ROS: see the doors by a laser; a PointCloud2 has to be named. Repeatable.",
    ),
]
PoseTopic = Annotated[
    str | None,
    typer.Option(
        "--pose-topic",
        metavar="TOPIC",
        help="With --scan: the robot's poses on the map, instead of TF from map.",
    ),
]

Heights = Annotated[
    str | None,
    typer.Option(
        "--heights",
        metavar="LOW,HIGH",
        help="With --scan: of a PointCloud2 these heights over the robot's frame, m; 0.3,1.5.",
    ),
]
RobotLevel = Annotated[
    str | None,
    typer.Option("--level", help="ROS: where the robot drives; needed if there are several."),
]

KeepScans = Annotated[
    bool,
    typer.Option(
        "--keep-scans",
        help="With --scan: keep the scans of visits in LOG.scans, for `view` and `scan-report`.",
    ),
]
ClickedPoints = Annotated[
    bool,
    typer.Option(
        "--clicked-points",
        help="ROS: two clicks of RViz's Publish Point are a door: its hinge, then its other end.",
    ),
]

MAPPING_HELP = """\
    \b
    ROS topics without --mapping: all lta_semantic_map/DoorMap,
    rmf_door_msgs/DoorState and DoorRequest; poses on /amcl_pose, /robot_pose,
    /semmap/robot_pose; /map, /map/level_N.

    \b
    A mapping file names topics, and says how each is read:
      topics:
        /door_db: door_map             a server's: differences become events
        /door_states: rmf_door_state   Open-RMF; also rmf_door_request
        /amcl_pose: pose               or tf (topics /tf and /tf_static)
        /map: floor_map
        /follow_waypoints/_action/status: patrol
        /front/contact:
          {read: sensor, door: front, states: {open: true, closed: false}}
        /scan: scan                    a laser: what it sees of the doors
        /clicked_point: clicked_points two clicks in RViz are a door
      repeats: 60                      s; sightings of the same are left out
    Every key, with examples: semmap_log/interop/topics/README.md
"""


def check_scan(scan: list[str] | None, pose_topic: str | None, heights: str | None) -> None:
    """Refuse options about lasers where there are none."""
    for option, given in (("--pose-topic", pose_topic), ("--heights", heights)):
        if given is not None and scan is None:
            raise typer.BadParameter("is for lasers: give --scan, too", param_hint=option)


def heights_of(text: str | None) -> tuple[float, float] | None:
    """Return a band of heights, as the command line has it; None: it was not given."""
    if text is None:
        return None
    try:
        low, high = map(float, text.split(","))
    except ValueError:
        low = high = math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise typer.BadParameter(
            f"expected two heights in metres, the lower first, as 0.3,1.5; got {text!r}",
            param_hint="--heights",
        )
    return low, high


def check_keep_scans(*, keep_scans: bool, dry_run: bool) -> None:
    """Refuse to keep what only is looked at."""
    if keep_scans and dry_run:
        raise typer.BadParameter("--dry-run writes nothing", param_hint="--keep-scans")


def tell_scan_import(file: Path, found: ScanImport) -> None:
    """Print the events that a bag would bring, those of visits with their notes."""
    from semmap_log.interop.importing.import_plan import ImportPlan

    for plan in (found.topics, found.earlier):
        show_events(plan.events)
    for visit in found.scans.visits:
        show_events(visit.commit.events, visit.commit.note)
    seen = sum(len(visit.commit.events) for visit in found.scans.visits)
    count = found.topics.count + found.earlier.count + seen
    tell_plan(
        file,
        ImportPlan((), count, found.summary, found.left_out, found.warnings),
    )


def show_events(events: Iterable[Event | EventBatch], note: Note | None = None) -> None:
    """Print events, a JSON line each, with who saw them where that is known."""
    from semmap_log.core.batches.event_batch import one_by_one
    from semmap_log.interop.formats.json.door_json import event_to_json

    said = {"actor": note.actor, "source": note.source, "reason": note.reason} if note else None
    for event in one_by_one(events):
        typer.echo(json_text(event_to_json(event, note=said)))


def tell_plan(file: Path, plan: ImportPlan) -> None:
    """Print a plan's events, a JSON line each, and say what else there is to it."""
    from semmap_log.core.texts import told_once

    show_events(plan.events)
    say(f"{file}: {counted(plan.count, 'event')}; nothing was written.")
    for text in plan.summary:
        say(f"  {text}")
    for text in told_once(plan.left_out):
        say(f"  left out: {text}")
    for text in told_once(plan.warnings):
        say(f"  warning: {text}")


PLOTS = (".png", ".svg")


def run(
    log: LogPath,
    bags: Annotated[
        list[Path] | None,
        typer.Argument(metavar="BAG", help="With scans; default: those kept beside the log."),
    ] = None,
    *,
    door: Annotated[
        list[str] | None, typer.Option("--door", metavar="DOOR", help="Only this one; repeatable.")
    ] = None,
    since: Since = None,
    until: Until = None,
    scan: Scan = None,
    pose_topic: PoseTopic = None,
    heights: Heights = None,
    level: RobotLevel = None,
    mapping: Annotated[
        Path | None,
        typer.Option("--mapping", metavar="YAML", help="Of ROS topics, as `import` takes it."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="OUT",
            help="Draw visits: into X.png or .svg; or into a folder, a picture a door.",
        ),
    ] = None,
    palette: PaletteChoice = PaletteName.default,
    as_json: AsJson = False,
) -> None:
    """Show how a laser saw each door: visits, what they say, how sure, where beams end.

    Of a bag its scans are looked through as `import --scan` does, and nothing is written to the
    log; without a bag it is about the scans that were kept next to the log by --keep-scans.

    A door marked with ! should be looked at; the lines below say why: its line is drawn next to its
    leaf, it may be of glass, or the poses are wrong. --plot draws of each door the visits that are
    least sure, and some of the others: where beams ended, where the laser went, the leaf where it
    most likely stands.

    \b
    Examples:
      semmap-log scan-report office patrol.bag
      semmap-log scan-report office patrol.bag --plot sightings.png
      semmap-log scan-report office --door front --plot front.png
      semmap-log scan-report office patrol --scan /front/scan --json
    """
    _check_plot(plot)
    bags = bags or []
    if not bags and any(each is not None for each in (scan, pose_topic, heights, level, mapping)):
        raise typer.BadParameter(
            "says how a BAG is read",
            param_hint="--scan, --pose-topic, --heights, --level, --mapping",
        )

    import semmap_log as sl
    from semmap_log.core.io.disk import refuse_own_folder
    from semmap_log.interop.formats.json.trip_json import scan_report_to_json
    from semmap_log.interop.importing.importing import ImportOptions
    from semmap_log.interop.importing.scan_reporting import seen_visits
    from semmap_log.interop.importing.scan_topics import ScanOptions

    opened = sl.read(log)
    tell_how_to_begin(opened)
    if plot is not None:
        refuse_own_folder(opened.path, plot)
    start, end = range_of(opened, since, until)
    options = ImportOptions(
        level=level,
        mapping=mapping,
        scan=ScanOptions(tuple(filter(None, scan or ())), pose_topic or "", heights_of(heights)),
    )
    with (
        progress("Reading", unit="messages") as told,
        seen_visits(
            opened, bags, options,
            doors=[opened.resolve_ever(name) for name in door] if door else None,
            since_ns=opened.instant(start), until_ns=opened.instant(end), progress=told,
        ) as seen,
    ):  # fmt: skip
        report = seen.report()
        if plot is not None:
            _plot(seen, report, plot, palette.colours)
    if as_json:
        print_json(scan_report_to_json(report))
    else:
        _tell(report)


def _check_plot(plot: Path | None) -> None:
    if plot is not None and plot.suffix and plot.suffix not in PLOTS:
        raise typer.BadParameter(
            f"expected a name that ends in .png or .svg, or a folder, got {plot}",
            param_hint="--plot",
        )


def _tell(report: ScanReport) -> None:
    from semmap_log.core.texts import told_once
    from semmap_log.views.scan_report_table import scan_report_table, warning_lines

    console().print(scan_report_table(report))
    for line in report.summary:
        say(line)
    for line in told_once(warning_lines(report)):
        say(f"warning: {line}")


def _plot(seen: SeenVisits, report: ScanReport, out: Path, palette: Palette) -> None:
    from semmap_log.core.texts import counted
    from semmap_log.views.plots.sighting_panels import (
        MOST_OF_EACH,
        MOST_OF_ONE,
        DoorPictures,
        plot_sightings,
    )
    from semmap_log.views.sightings.visit_words import drawn_visits

    if not report.doors:
        say(f"{out}: not written; no door was visited.")
        return
    is_one_a_door = not out.suffix
    alone = is_one_a_door or len(report.doors) == 1
    drawn = drawn_visits(seen.visits, MOST_OF_ONE if alone else MOST_OF_EACH)
    pictures = [DoorPictures(report.label(door.door_id), door, drawn[door.door_id])
                for door in report.doors]  # fmt: skip
    zone = seen.log.info.timezone
    if not is_one_a_door:
        plot_sightings(pictures, out, tz=zone, palette=palette)
        say(f"{out}: {counted(len(pictures), 'door')}.")
        return
    _make_folder(out)
    for each in pictures:
        plot_sightings([each], out / f"door_{each.figures.door_id}.png", tz=zone, palette=palette)
    say(f"{out}: {counted(len(pictures), 'picture')}, door_{pictures[0].figures.door_id}.png …")


def _make_folder(folder: Path) -> None:
    from semmap_log.core.io.disk import output_errors

    with output_errors(folder):
        folder.mkdir(exist_ok=True)
