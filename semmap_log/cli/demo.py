"""`demo`: the main job in one go."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semmap_log.cli.common import console, say


def run(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to put what it makes.")] = (
        Path("demo")
    ),
) -> None:
    """Record a patrol, replay it to three moments, export it, and save it for the viewer.

    Works on a shipped recording: no network, no ROS, well under a minute.

    \b
    Examples:
      semmap-log demo
      semmap-log demo /tmp/look
    """  # noqa: D301
    from semmap_log.demo import run_demo
    from semmap_log.moments import format_local
    from semmap_log.views.tables import door_table

    made = run_demo(folder, tell=say)
    out = console()
    tz = _zone(made.log)
    titles = ("Before the recording", "In the middle of it", "After it")
    for title, door_map in zip(titles, made.moments, strict=True):
        assert door_map.at_ns is not None
        out.print(f"\n{title}, at {format_local(door_map.at_ns, tz)}:")
        out.print(door_table(door_map, now_ns=door_map.at_ns, tz=tz))
    end = made.moments[-1].at_ns
    assert end is not None
    moment = format_local(end - 3600 * 10**9, tz)
    out.print(f"\nMade in {made.folder}:")
    out.print(
        f"  {made.log.name}/       the log: {made.copied} events copied, {made.recorded} recorded"
    )
    out.print(f"  {made.yaml.name}    the doors for the thesis's server")
    if made.rrd is not None:
        out.print(f"  {made.rrd.name}    the history for the rerun viewer")
    else:
        out.print(f"  (no picture: {made.rrd_problem})")
    out.print("\nWhat to type next:")
    for command in (
        f"semmap-log history {made.log} -n 10",
        f'semmap-log replay {made.log} --at "{moment}"',
        f'semmap-log diff {made.log} "2h ago" now',
        f"semmap-log view {made.log}",
    ):
        out.print(f"  {command}")


def _zone(log: Path) -> str:
    import semmap_log as sl

    return sl.read(log).info.timezone
