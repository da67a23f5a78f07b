"""`join`: several robots' logs of one building as one log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, a_local_log, console, print_json, progress, say
from semmap_log.core.model.rigid_transform import EXPECTED, RigidTransform
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import LogError

if TYPE_CHECKING:
    from semmap_log.fleet.join.door_plan import DoorPlan
    from semmap_log.fleet.join.joined_logs import JoinDefinition, JoinedLogs


def run(
    out: Annotated[
        Path, typer.Argument(metavar="OUT.join.json", help="The join; asked as a log is.")
    ],
    logs: Annotated[
        list[str] | None,
        typer.Argument(metavar="LOG...", help="Folders, zips, URLs; none: the join is there."),
    ] = None,
    *,
    doors: Annotated[
        Path | None,
        typer.Option("--doors", metavar="CSV", help="Table: log, door, building door."),
    ] = None,
    frame: Annotated[
        list[str] | None,
        typer.Option("--frame", metavar="LOG=DX,DY,THETA", help="Where its map lies (m, rad)."),
    ] = None,
    reference: Annotated[
        str, typer.Option("--reference", metavar="LOG", help="Whose map is the building's.")
    ] = "",
    propose: Annotated[
        bool, typer.Option("--propose", help="Print doors that lie at one place; join nothing.")
    ] = False,
    write_doors: Annotated[
        Path | None,
        typer.Option("--write-doors", metavar="CSV", help="Write the proposals as a table."),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option("--write", metavar="NEW", help="Make a log of its own of the join."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Join several robots' logs of one building into one door map, which is queried like a log.

    Doors of one level and name, unique in each log, are one; so are those of the table. All others
    are called log/door. Of each field the latest event counts, whichever log has it. The logs stay
    as they are; where one grows, the next question sees it.

    \b
    Examples:
      semmap-log join clinic.join.json tug1 tug2 --frame tug2=12.5,-3,1.5708
      semmap-log join clinic.join.json tug1 tug2 --propose --write-doors m.csv
      semmap-log join clinic.join.json tug1 s3://logs/tug2 --doors m.csv
      semmap-log history clinic.join.json front
      semmap-log join clinic.join.json --write clinic
    """
    from semmap_log.fleet.join.door_plan import plan_doors
    from semmap_log.fleet.join.joined_logs import open_joined, write_definition

    definition = _defined(out, logs or [], doors, frame or [], reference)
    joined = open_joined(definition)
    plan = plan_doors(joined)
    if propose or write_doors is not None:
        _propose(joined, plan, write_doors, as_json=as_json)
        return
    if logs:
        write_definition(out, definition)
    if write is not None:
        _write(joined, plan, a_local_log(write))
    _tell(joined, plan, as_json=as_json)


def _defined(
    out: Path, logs: list[str], doors: Path | None, frame: list[str], reference: str
) -> JoinDefinition:
    from semmap_log.fleet.join.joined_logs import read_definition
    from semmap_log.fleet.join.joining_logs import defined

    if not logs:
        if doors is not None or frame or reference:
            raise typer.BadParameter(
                "expected the logs, too: --doors, --frame and --reference write a new definition"
            )
        return read_definition(out)
    told = [frame_of(each) for each in frame]
    if len({name for name, _ in told}) < len(told):
        raise typer.BadParameter("a log has one frame", param_hint="--frame")
    frames = {name: (at.dx, at.dy, at.theta) for name, at in told}
    return defined(logs, doors=doors, frames=frames, reference=reference)


def _write(joined: JoinedLogs, plan: DoorPlan, new: Path) -> None:
    from semmap_log.fleet.join.join_building import build_join
    from semmap_log.fleet.join.joining_logs import seed_of

    with progress("Writing", "events") as told:
        seed = seed_of(joined) + b"written"
        built = build_join(joined, plan, new, seed, names_origin=True, progress=told)
    say(f"{new}: a new log of {counted(built.events, 'event')}")
    for log, kinds in built.left_out.items():
        if kinds:
            kind_counts = ", ".join(f"{count:,} {kind}" for kind, count in sorted(kinds.items()))
            say(f"of {log} are left out, since they do not count in the building: {kind_counts}")


def _propose(joined: JoinedLogs, plan: DoorPlan, out: Path | None, *, as_json: bool) -> None:
    from semmap_log.fleet.join.join_building import propose_doors
    from semmap_log.fleet.join.joined_logs import write_door_rows
    from semmap_log.views.join_table import door_proposals_table

    found = propose_doors(joined, plan)
    if out is not None:
        rows = dict.fromkeys(row for each in found for row in each.rows())
        write_door_rows(out, rows)
        say(f"{out}: {counted(len(rows), 'row')}. Look at them, then join with --doors {out}")
    if as_json:
        print_json(
            [
                {
                    "first": {"log": each.first.log, "door": each.first.door_id},
                    "second": {"log": each.second.log, "door": each.second.door_id},
                    "apart_m": each.apart_m,
                }
                for each in found
            ]
        )
    elif found:
        console().print(door_proposals_table(found))
    else:
        say("no two doors that are not one yet lie at one place (logs without a frame lie nowhere)")


def _tell(joined: JoinedLogs, plan: DoorPlan, *, as_json: bool) -> None:
    from semmap_log.fleet.join.join_building import door_conflicts
    from semmap_log.views.join_table import (
        door_conflicts_table,
        joined_doors_table,
        joined_logs_table,
    )

    conflicts = door_conflicts(joined, plan)
    if as_json:
        print_json(to_json(joined, plan))
        return
    out = console()
    out.print(joined_logs_table(joined, Path.cwd()))
    out.print()
    out.print(joined_doors_table(plan.doors))
    if conflicts:
        out.print()
        out.print(door_conflicts_table(conflicts))
        say(f"{counted(len(conflicts), 'conflict')}: of each field the latest event counts")
    if plan.unmatched and len(joined.logs) > 1:
        line = command_line("join", "OUT.join.json", "LOG", "LOG", "--propose")
        said = f"{counted(len(plan.unmatched), 'door')} told of by one log alone"
        say(f"{said}; which may be one: {line}")


def to_json(joined: JoinedLogs, plan: DoorPlan) -> dict[str, Any]:
    """Return a join as `--json` prints it."""
    from semmap_log.fleet.join.join_building import door_conflicts

    return {
        "reference": joined.reference.name,
        "logs": [
            {
                "log": log.name,
                "log_id": log.log_id,
                "place": str(log.place),
                "events": log.last_event + 1,
                "head": log.head.hex(),
                "frame": None if log.frame is None else log.frame.as_list(),
            }
            for log in sorted(joined.logs, key=lambda log: log.name)
        ],
        "doors": [
            {
                "door": door.door_id,
                "name": door.name,
                "of": [{"log": each.log, "door": each.door_id} for each in door.doors],
                "is_shared": door.is_shared,
            }
            for door in plan.doors
        ],
        "conflicts": [
            {"door": each.door.door_id, "what": each.what, "says": list(each.says)}
            for each in door_conflicts(joined, plan)
        ],
    }


def frame_of(text: str) -> tuple[str, RigidTransform]:
    """Return a log's name, and the transform to the building's frame, of `log=dx,dy,theta`.

    Raises:
        LogError: It is none.
    """
    name, _, numbers = text.rpartition("=")
    try:
        if name:
            return name, RigidTransform.parse(numbers)
    except LogError:
        if _are_numbers(numbers):  # and one of them is not finite
            raise
    raise LogError(f"{text!r}: expected LOG={EXPECTED}, such as tug2=12.5,-3,1.5708.")


def _are_numbers(text: str) -> bool:
    try:
        return len([float(number) for number in text.split(",")]) == 3
    except ValueError:
        return False
