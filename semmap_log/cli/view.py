"""`view`: the history as a picture that moves."""

from __future__ import annotations

import os
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli import common
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.core.model.doors import DoorId
    from semmap_log.log import DoorLog
    from semmap_log.views.rerun.live_view import WebViewer
    from semmap_log.views.rerun.recording import RrdSummary


class ThemeName(str, Enum):
    """`web.Theme`, as typer wants its choices."""

    light = "light"
    dark = "dark"


def run(
    log: common.LogPath,
    *,
    since: common.Since = None,
    until: common.Until = None,
    at: Annotated[
        str | None, typer.Option("--at", metavar="TIME", help="Moment to show; default: the end.")
    ] = None,
    door: Annotated[
        list[str] | None, typer.Option("--door", metavar="DOOR", help="Only this one; repeatable.")
    ] = None,
    object_class: common.OfClass = None,
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
    scans: Annotated[
        bool,
        typer.Option(
            "--scans/--no-scans",
            help="With the scans that --keep-scans of record or import kept: a view a door.",
        ),
    ] = True,
    palette: common.PaletteChoice = common.PaletteName.default,
    follow: Annotated[
        bool,
        typer.Option("-f", "--follow", help="Go on with what comes, while another process writes."),
    ] = False,
    web: Annotated[
        bool, typer.Option("--web", help="In a browser of this machine; says the address.")
    ] = False,
    browser: Annotated[
        bool, typer.Option("--open", help="With --web: open the address in the browser.")
    ] = False,
    theme: Annotated[
        ThemeName | None,
        typer.Option("--theme", help="With --web; default: the browser's. A window has its own."),
    ] = None,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="X.rrd", help="Write a file, open nothing.")
    ] = None,
    screenshot: Annotated[
        Path | None,
        typer.Option("--screenshot", metavar="X.png", help="Write a picture; needs no screen."),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            "--size", metavar="WxH", help="Of the picture, in pixels; default: 1920x1080."
        ),
    ] = None,
    view: Annotated[
        str | None,
        typer.Option("--view", metavar="NAME", help="Of the picture: this view alone, by title."),
    ] = None,
    as_json: common.AsJson = False,
) -> None:
    """Look at the history in the rerun viewer: floor plan, doors, state lanes, events, robot.

    Scrub along `happened` to see what was true, along `recorded` to see when it became known.
    Events that were retracted are there along `recorded`, until that was known. It opens at the
    end, or at the moment of --at.

    Where scans of sightings were kept, the tabs Sightings show of each door what the laser saw at
    the last visit: beams by what became of them, the leaf where it most likely stands, what was
    reported. Step along `happened` from visit to visit. Of many doors name those to be shown
    (--door).

    With --follow, what is recorded meanwhile is on the screen within a second; beliefs stay as they
    were at first, and no scans are shown. Close the window, or press Ctrl-C, to end it.

    --web serves on 127.0.0.1 alone. The page is rerun's own: it may ask the internet for a font and
    for news of rerun, and report its use; never the log. In browsers without WebGPU rerun draws
    hundreds of doors next to their walls; a window does not.

    \b
    Examples:
      semmap-log view office
      semmap-log view office --since "yesterday 08:00" --door front
      semmap-log view office --save office.rrd
      semmap-log view office --at 2026-03-02T14:02 --screenshot office.png
      semmap-log view office --screenshot plan.png --view "Floor plan"
      semmap-log view office --follow --since "2h ago"
      semmap-log view office --web --follow --palette colour-blind
    """
    given = {
        "--follow": follow, "--web": web, "--save": save, "--screenshot": screenshot,
        "--open": browser, "--theme": theme, "--size": size, "--view": view,
        "--at": at, "--until": until,
    }  # fmt: skip
    _check_together({option for option, value in given.items() if value})
    if as_json and not (save or screenshot):
        raise typer.BadParameter("tells what --save or --screenshot wrote", param_hint="--json")
    _check_ending("--save", save, ".rrd")
    _check_ending("--screenshot", screenshot, ".png")
    pixels = (1920, 1080) if size is None else _pixels(size)

    from semmap_log.core.io.disk import check_outside_log
    from semmap_log.log import read

    opened = read(log)
    common.print_empty_log_hint(opened)
    if screenshot is not None:
        check_outside_log(opened.path, screenshot)
    if follow:
        os.environ.setdefault("RUST_LOG", SDK_SAYS)
    start, end = common.range_of(opened, since, until)
    if follow and end is not None:
        raise typer.BadParameter("--follow has no end; leave T2 out", param_hint="--since")
    doors = common.doors_meant(opened, door, object_class)
    at_ns = opened.moment(at).ns if at else None
    _warn_of_names(opened, doors)
    looks: dict[str, Any] = {
        "since": start, "doors": doors, "palette": palette.colours, "costmap": costmap,
        "beliefs": beliefs,
    }  # fmt: skip
    if follow:
        _follow(opened, looks, web=web, theme=theme, browser=browser)
        return
    from semmap_log.interop.formats.kept_scans.reading import kept_visits

    reader = kept_visits if scans else None
    with _recording(opened, save, {**looks, "scans": reader, "until": end, "at": at}) as (
        rrd,
        summary,
    ):
        if screenshot is not None:
            _take_picture(rrd, screenshot, at_ns=at_ns, size=pixels, view=view)
        elif web:
            _serve(rrd, theme=theme, browser=browser)
        elif save is None:
            from semmap_log.views.rerun.process import open_viewer

            open_viewer(rrd, at_ns=at_ns)
    if as_json:
        common.print_json({
            "save": None if save is None else str(save),
            "screenshot": None if screenshot is None else str(screenshot),
            "events": summary.events,
            "left_out": {
                **asdict(summary.left_out), "sightings": summary.sightings_left_out
            },
        })  # fmt: skip


MOST_PIXELS = 8192
"""A side of a picture: what every graphics driver, a software one too, can draw at once."""

EXCLUDES = {
    "--follow": ("--save", "--screenshot", "--at", "--until"),
    "--web": ("--save", "--screenshot", "--at"),
}
NEEDS = {"--open": "--web", "--theme": "--web", "--size": "--screenshot", "--view": "--screenshot"}


def _check_together(given: set[str]) -> None:
    """Refuse options that make no sense together, or not without another one.

    Raises:
        typer.BadParameter: Names both.
    """
    for option, others in EXCLUDES.items():
        for other in others:
            if {option, other} <= given:
                raise typer.BadParameter(f"{option} does not go with {other}", param_hint=option)
    for option, other in NEEDS.items():
        if option in given and other not in given:
            raise typer.BadParameter(f"{option} is of use with {other} alone", param_hint=option)


def _check_ending(option: str, path: Path | None, ending: str) -> None:
    if path is not None and path.suffix != ending:
        raise typer.BadParameter(
            f"expected a name that ends in {ending}, got {path}", param_hint=option
        )


def _pixels(size: str) -> tuple[int, int]:
    width, _, height = size.partition("x")
    sides = [int(side) if side.isdecimal() and len(side) < 6 else 0 for side in (width, height)]
    if not all(0 < side <= MOST_PIXELS for side in sides):
        raise typer.BadParameter(
            f"expected width and height such as 1280x800, neither above {MOST_PIXELS}, got {size}",
            param_hint="--size",
        )
    return sides[0], sides[1]


def _warn_of_names(opened: DoorLog, doors: list[DoorId] | None) -> None:
    """Say once that the viewer's font lacks letters, if it does."""
    from semmap_log.views.rerun.drawable import is_drawable_name

    names = {n: name for n, name in opened.door_names().items() if doors is None or n in doors}
    lacking = [n for n, name in names.items() if not is_drawable_name(name)]
    if lacking:
        common.say(
            f"The viewer's font lacks letters in the names of {counted(len(lacking), 'door')}: "
            f'there they are called by their numbers, such as "door {lacking[0]}". The page that '
            f"`report` writes shows all names."
        )


@contextmanager
def _recording(
    opened: DoorLog, save: Path | None, looks: dict[str, Any]
) -> Iterator[tuple[Path, RrdSummary]]:
    """Write the recording, to be kept or to be gone at the end; hand out path and summary."""
    from semmap_log.core.io.disk import log_name
    from semmap_log.views.rerun.recording import save_rrd

    with tempfile.TemporaryDirectory(prefix="semmap-log-") as folder:
        path = save or Path(folder) / f"{log_name(opened.path)}.rrd"
        with common.progress("Replaying") as told:
            summary = save_rrd(opened, path, progress=told, **looks)
        if save is not None:
            common.say(
                f"{save}: {counted(summary.events, 'event')}, {common.size_of(summary.bytes)}, "
                f"{summary.seconds:.1f} s. To look at it: rerun {shlex.quote(str(save))}"
            )
            if left_out := str(summary.left_out):
                common.say(f"As no eye would see them, {left_out}.")
        for problem in summary.problems:
            common.say(f"warning: {problem}")
        if left := summary.sightings_left_out:
            common.say(f"{counted(left, 'sighting')} of doors not shown; name doors with --door.")
        yield path, summary


def _take_picture(rrd: Path, png: Path, **how: Any) -> None:
    from semmap_log.views.rerun.process import screenshot

    screenshot(rrd, png, **how)
    common.say(f"{png}: written.")


def _serve(rrd: Path, *, theme: ThemeName | None, browser: bool) -> None:
    from semmap_log.views.rerun.live_view import web_viewer

    try:
        with web_viewer(rrd) as viewer:
            _print_address(viewer, theme, browser=browser)
            viewer.program.process.wait()
            raise viewer.program.failure()
    except KeyboardInterrupt:
        return  # the way to end it


SDK_SAYS = "warn,re_grpc_client=off,re_sdk=off"
"""Read as rerun is loaded. That the viewer has gone is no error when its window was closed; if it
is one, we say so."""


def _follow(
    opened: DoorLog, looks: dict[str, Any], *, web: bool, theme: ThemeName | None, browser: bool
) -> None:
    from semmap_log.errors import ViewerError
    from semmap_log.views.rerun.live_view import LiveViewOptions, follow_in_viewer, web_viewer
    from semmap_log.views.rerun.process import RerunProcess, window

    def show(program: RerunProcess, forget: Callable[[str], None] | None = None) -> None:
        try:
            with common.progress("Replaying") as told:
                follow_in_viewer(
                    opened, program.url, LiveViewOptions(**looks),
                    stop=program.has_ended, forget=forget, progress=told,
                )  # fmt: skip
        except ViewerError:
            if not program.ended_well():
                raise
        program.ended_well()

    try:
        if web:
            with web_viewer() as served:
                _print_address(served, theme, browser=browser)
                show(served.program)
        else:
            with window() as viewer:
                viewer.state()  # fails early if there is no screen
                show(viewer.program, viewer.forget)
    except KeyboardInterrupt:
        return  # the way to end it


def _print_address(viewer: WebViewer, theme: ThemeName | None, *, browser: bool) -> None:
    address = viewer.page(None if theme is None else theme.value)
    typer.echo(address)
    common.say("Open this address in a browser of this machine; Ctrl-C ends it.")
    sys.stdout.flush()
    if browser:
        import webbrowser

        if not webbrowser.open(address):
            common.say("No browser could be opened here.")
