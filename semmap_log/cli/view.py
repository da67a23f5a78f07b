"""`view`: the history as a picture that moves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semmap_log.cli.common import LogPath, progress, say


def run(
    log: LogPath,
    *,
    since: Annotated[
        str | None, typer.Option("--from", metavar="TIME", help="From then on.")
    ] = None,
    until: Annotated[str | None, typer.Option("--to", metavar="TIME", help="Before then.")] = None,
    at: Annotated[
        str | None, typer.Option("--at", metavar="TIME", help="Moment to show; default: the end.")
    ] = None,
    door: Annotated[
        list[str] | None, typer.Option("--door", metavar="DOOR", help="Only this one; repeatable.")
    ] = None,
    costmap: Annotated[
        bool,
        typer.Option(
            "--costmap/--no-costmap", help="With the costmap's door layer, in a tab of its own."
        ),
    ] = True,
    beliefs: Annotated[
        bool,
        typer.Option(
            "--beliefs/--no-beliefs",
            help="With what could be believed: P(open) over time, and typical weeks.",
        ),
    ] = True,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="X.rrd", help="Write a file, open nothing.")
    ] = None,
    screenshot: Annotated[
        Path | None,
        typer.Option("--screenshot", metavar="X.png", help="Write a picture, headless."),
    ] = None,
) -> None:
    """Look at the history in the rerun viewer: floor plan, doors, state lanes, events, robot.

    Scrub along `happened` to see what was true, along `recorded` to see when it became known.
    Retracted events are left out.

    \b
    Examples:
      semmap-log view office
      semmap-log view office --from "yesterday 08:00" --door front --save office.rrd
      semmap-log view office --at 2026-03-02T14:02 --screenshot office.png
    """
    import tempfile

    import semmap_log as sl
    from semmap_log.views.rerun.recording import save_rrd
    from semmap_log.views.rerun.viewer import open_viewer
    from semmap_log.views.rerun.viewer import screenshot as take_screenshot

    opened = sl.read(log)
    doors = [opened.resolve_ever(name) for name in door] if door else None
    if save is not None and save.suffix != ".rrd":
        raise typer.BadParameter(
            f"expected a name that ends in .rrd, got {save}", param_hint="--save"
        )
    if screenshot is not None and screenshot.suffix != ".png":
        raise typer.BadParameter(
            f"expected a name that ends in .png, got {screenshot}", param_hint="--screenshot"
        )
    folder = None if save else Path(tempfile.mkdtemp(prefix="semmap-log-"))
    path = save or Path(str(folder)) / f"{log.resolve().name}.rrd"
    with progress("Replaying") as told:
        summary = save_rrd(
            opened,
            path,
            since=since,
            until=until,
            doors=doors,
            at=at,
            costmap=costmap,
            beliefs=beliefs,
            progress=told,
        )
    if save is not None:
        say(
            f"{save}: {summary.events} events, {summary.bytes / 1e6:.1f} MB, "
            f"{summary.seconds:.1f} s. To look at it: rerun {save}"
        )
    at_ns = opened.moment(at).ns if at else None
    if screenshot is not None:
        take_screenshot(path, screenshot, at_ns=at_ns)
        say(f"{screenshot}: written.")
    if save is None and screenshot is None:
        open_viewer(path, at_ns=at_ns)
