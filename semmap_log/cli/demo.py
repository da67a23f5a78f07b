"""`demo`: the main job in one go."""

from __future__ import annotations

import sys
from dataclasses import asdict
from functools import partial
from itertools import count
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, console, print_json, say
from semmap_log.core.texts import PROGRAM, command_line, counted

if TYPE_CHECKING:
    from semmap_log.cli.demonstration.demo import Demo, SeenByLaser
    from semmap_log.views.column_table import ColumnTable


def run(
    folder: Annotated[
        Path | None,
        typer.Argument(metavar="DIR", help="Where to put what it makes; default: demo, demo-2, …"),
    ] = None,
    *,
    as_json: AsJson = False,
) -> None:
    """Record a patrol, replay it, estimate P(open), see doors by laser, export it all.

    Works on a shipped recording: no network, no ROS, well under a minute.

    \b
    Examples:
      semmap-log demo
      semmap-log demo /tmp/look
    """
    from semmap_log.cli.demonstration.demo import run_demo
    from semmap_log.core.model.moments import format_short
    from semmap_log.views.belief_table import belief_table
    from semmap_log.views.tables import door_table

    made = run_demo(folder or _free_folder(), tell=say)
    if as_json:
        print_json(_to_json(made))
        return
    tz = _zone(made.log)
    titles = ("Before the recording", "In the middle of it", "After it")
    for title, door_map in zip(titles, made.moments, strict=True):
        typer.echo(f"\n{title}:")
        console().print(door_table(door_map, tz=tz))
    typer.echo("\nHow likely they were open in the middle of it, from what was known then:")
    console().print(belief_table(made.beliefs, tz=tz))
    typer.echo("\nWhat a laser's scans of four minutes said of the doors, beside the truth:")
    console().print(_seen_table(made.seen, tz))
    end_ns = made.moments[-1].at_ns
    assert end_ns is not None
    picture = f"{made.rrd.name}   the history, for the rerun viewer" if made.rrd else "no picture"
    copied = counted(made.copied, "event")
    typer.echo(
        f"\nMade in {made.folder}:\n"
        f"  {made.log.name}/      the log: {copied} copied, {made.recorded} recorded\n"
        f"  {made.seen.log.name}/   another log: what the laser saw of the doors\n"
        f"  {made.yaml.name}   the doors, for the thesis's server\n"
        f"  {made.costmap.name}  the costmap in the middle of it\n"
        f"  {made.report.name}  the history, for any browser\n"
        f"  {picture}"
    )
    if made.rrd_problem:
        say(made.rrd_problem)
    noon = format_short(end_ns - 8 * 3600 * 10**9, tz, seconds=False)
    line = partial(command_line, program=PROGRAM if which(PROGRAM) else sys.argv[0])
    typer.echo(
        "\n  ".join([
            "\nWhat to type next:",
            line("history", made.log, "-n", "10"),
            line("replay", made.log, "--at", noon),
            line("diff", made.log, "2h ago", "now"),
            line("probabilities", made.log, "--horizon", "1h"),
            line("costmap", made.log, "now.png", "--inflate", "0.5"),
            line("view", made.log),
        ])
    )  # fmt: skip


def _seen_table(seen: SeenByLaser, tz: str) -> ColumnTable:
    """Return the scans' results and the truth, a row a visit."""
    from semmap_log.core.model.moments import format_short
    from semmap_log.views.column_table import ColumnTable, TableColumn

    columns = ("time", "door", "scans say", "accuracy", "truth")
    table = ColumnTable([TableColumn(title, title) for title in columns])
    for door in seen.doors:
        said = f"{door.said} (driven through)" if door.passed else door.said
        time = format_short(door.happened_ns, tz)
        table.add(time, door.name, said, f"{door.accuracy:.3f}", door.truth)
    return table


def _to_json(made: Demo) -> dict[str, Any]:
    return {
        "folder": str(made.folder),
        "log": str(made.log),
        "seen_by_laser": [asdict(seen) for seen in made.seen.doors],
        "events": made.copied + made.recorded,
        "files": [
            str(path)
            for path in (made.yaml, made.costmap, made.report, made.rrd)
            if path is not None
        ],
    }


def _free_folder() -> Path:
    """Return the first of demo, demo-2, demo-3 … that is not there."""
    folder = Path("demo")
    for number in count(2):
        if not folder.exists():
            break
        folder = Path(f"demo-{number}")
    return folder


def _zone(log: Path) -> str:
    from semmap_log.log import read

    return read(log).info.timezone
