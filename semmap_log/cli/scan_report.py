"""`scan-report`: how a laser saw the doors, and how far to trust it.

It has what the verbs share that read ROS messages: the mapping's option, its help, the dry run.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import common
from semmap_log.cli.bag_options import Heights, PoseTopic, RobotLevel, Scan, heights_of
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.analysis.scans.door_figures import ScanReport
    from semmap_log.interop.importing.scan_reporting import SeenVisits
    from semmap_log.views.palette import Palette


PLOTS = (".png", ".svg")


def run(
    log: common.LogPath,
    bags: Annotated[
        list[Path] | None,
        typer.Argument(metavar="BAG", help="With scans; default: those kept beside the log."),
    ] = None,
    *,
    door: Annotated[
        list[str] | None, typer.Option("--door", metavar="DOOR", help="Only this one; repeatable.")
    ] = None,
    since: common.Since = None,
    until: common.Until = None,
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
    palette: common.PaletteChoice = common.PaletteName.default,
    as_json: common.AsJson = False,
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

    from semmap_log.core.io.disk import check_outside_log
    from semmap_log.interop.formats.json.trip_json import scan_report_to_json
    from semmap_log.interop.importing.importing import ImportOptions
    from semmap_log.interop.importing.scan_reporting import seen_visits
    from semmap_log.interop.importing.scan_topics import ScanOptions
    from semmap_log.log import read

    opened = read(log)
    common.print_empty_log_hint(opened)
    if plot is not None:
        check_outside_log(opened.path, plot)
    start, end = common.range_of(opened, since, until)
    options = ImportOptions(
        level=level,
        mapping=mapping,
        scan=ScanOptions(tuple(filter(None, scan or ())), pose_topic or "", heights_of(heights)),
    )
    with (
        common.progress("Reading", unit="messages") as told,
        seen_visits(
            opened, bags, options,
            doors=[opened.resolve_any_door(name) for name in door] if door else None,
            since_ns=opened.instant(start), until_ns=opened.instant(end), progress=told,
        ) as seen,
    ):  # fmt: skip
        report = seen.report()
        if plot is not None:
            _plot(seen, report, plot, palette.colours)
    if as_json:
        common.print_json(scan_report_to_json(report))
    else:
        _tell(report)


def _check_plot(plot: Path | None) -> None:
    if plot is not None and plot.suffix and plot.suffix not in PLOTS:
        raise typer.BadParameter(
            f"expected a name that ends in .png or .svg, or a folder, got {plot}",
            param_hint="--plot",
        )


def _tell(report: ScanReport) -> None:
    from semmap_log.core.texts import deduplicated
    from semmap_log.views.scan_report_table import scan_report_table, warning_lines

    common.console().print(scan_report_table(report))
    for line in report.summary:
        common.say(line)
    for line in deduplicated(warning_lines(report)):
        common.say(f"warning: {line}")


def _plot(seen: SeenVisits, report: ScanReport, out: Path, palette: Palette) -> None:
    from semmap_log.views.plots import sighting_panels
    from semmap_log.views.sightings.visit_words import drawn_visits

    if not report.doors:
        common.say(f"{out}: not written; no door was visited.")
        return
    is_one_a_door = not out.suffix
    alone = is_one_a_door or len(report.doors) == 1
    drawn = drawn_visits(
        seen.visits, sighting_panels.MOST_OF_ONE if alone else sighting_panels.MOST_OF_EACH
    )
    pictures = [sighting_panels.DoorPictures(report.label(door.door_id), door, drawn[door.door_id])
                for door in report.doors]  # fmt: skip
    zone = seen.log.info.timezone
    if not is_one_a_door:
        sighting_panels.plot_sightings(pictures, out, tz=zone, palette=palette)
        common.say(f"{out}: {counted(len(pictures), 'door')}.")
        return
    _make_folder(out)
    for each in pictures:
        sighting_panels.plot_sightings(
            [each], out / f"door_{each.figures.door_id}.png", tz=zone, palette=palette
        )
    common.say(
        f"{out}: {counted(len(pictures), 'picture')}, door_{pictures[0].figures.door_id}.png …"
    )


def _make_folder(folder: Path) -> None:
    from semmap_log.core.io.disk import output_errors

    with output_errors(folder):
        folder.mkdir(exist_ok=True)
