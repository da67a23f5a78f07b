"""`import --scan --propose-doors`: doors that a laser saw and the log lacks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from semmap_log.cli.common import console, print_json, progress, say
from semmap_log.core.texts import command_line, counted

if TYPE_CHECKING:
    from semmap_log.interop.importing.door_proposing import ProposedDoors
    from semmap_log.interop.importing.importing import ImportOptions
    from semmap_log.log import DoorLog

ProposeDoors = Annotated[
    bool,
    typer.Option(
        "--propose-doors",
        help="With --scan: list doors that the laser saw and the log lacks; add them with --yes.",
    ),
]
Yes = Annotated[
    bool, typer.Option("--yes", help="With --propose-doors: add what is proposed, as one commit.")
]
Only = Annotated[
    list[str] | None,
    typer.Option(
        "--only",
        metavar="N|PATTERN",
        help="With --yes: this number. CSV: doors called so, as 'binary_sensor.*door*'. "
        "Repeatable.",
    ),
]
Plot = Annotated[
    Path | None,
    typer.Option(
        "--plot", metavar="OUT.png", help="With --propose-doors: a picture of them; or .svg."
    ),
]


class Proposing(NamedTuple):
    """The options."""

    is_requested: bool
    yes: bool
    only: list[int] | None
    plot: Path | None


def check_proposing(asked: Proposing, *, has_scan: bool, files: list[Path], dry_run: bool) -> None:
    """Refuse options of proposals without proposals, and proposals without a laser."""
    if not asked.is_requested:
        if asked.yes or asked.only or asked.plot is not None:
            raise typer.BadParameter(
                "is about proposed doors: give --propose-doors", param_hint="--yes, --only, --plot"
            )
        return
    if not has_scan:
        raise typer.BadParameter("a laser sees them: give --scan", param_hint="--propose-doors")
    if len(files) != 1:
        raise typer.BadParameter("expected one bag", param_hint="FILE")
    if dry_run and asked.yes:
        raise typer.BadParameter("without --yes nothing is added", param_hint="--dry-run")
    if asked.only and not asked.yes:
        raise typer.BadParameter("says which of them are added: give --yes", param_hint="--only")


def numbers_of(only: list[str] | None) -> list[int] | None:
    """Return which proposals are meant; None: no option says so."""
    if only is None:
        return None
    if not all(text.isdecimal() and int(text) > 0 for text in only):
        raise typer.BadParameter("expected numbers of proposals", param_hint="--only")
    return [int(text) for text in only]


def propose(
    log: Path, file: Path, options: ImportOptions, asked: Proposing, *, actor: str, reason: str,
    as_json: bool,
) -> None:  # fmt: skip
    """List, draw and add the doors that a bag's scans show; nothing else of it is imported.

    Raises:
        FormatError: It is no bag, cannot be read, or no scan of it has a place on the map.
        CommandError: A number that no proposal has.
    """
    from semmap_log.core.model.commits import Note
    from semmap_log.errors import CommandError
    from semmap_log.interop.importing.door_proposing import append_proposed, propose_doors
    from semmap_log.log import append, read

    opened = read(log)
    with progress(f"Reading {file.name}", unit="messages") as told:
        found = propose_doors(opened, file, options, told)
    unknown = [number for number in asked.only or () if number > len(found.proposals)]
    if unknown:
        raise CommandError(
            f"--only {unknown[0]}: expected a number up to {len(found.proposals)}, as listed."
        )
    if asked.plot is not None:
        _plot(opened, file, found, asked.plot)
    added: list[int] = []
    if asked.yes and found.proposals:
        note = Note(actor=actor, source=str(file), reason=reason)
        with append(log) as writer:
            added = [*append_proposed(writer, found, note, asked.only or ())]
    if as_json:
        _print_json(file, found, added)
    else:
        _tell(_command(log, file, options), file, found, added, asked)


def _command(log: Path, file: Path, options: ImportOptions) -> str:
    """Return the command that adds what is proposed now."""
    words = [] if options.scan is None else options.scan.words()
    if options.level is not None:
        words += ["--level", options.level]
    if options.mapping is not None:
        words += ["--mapping", str(options.mapping)]
    return command_line("import", log, str(file), *words, "--propose-doors", "--yes")


def _plot(log: DoorLog, file: Path, found: ProposedDoors, path: Path) -> None:
    from semmap_log.views.plots.proposed_doors import plot_proposed

    title = f"Doors proposed from {file.name}: {len(found.proposals)}"
    doors = [*log.replay().doors.values()]
    plot_proposed(found.proposals, doors, path, walls=found.walls, ends=found.ends, title=title)


def _print_json(file: Path, found: ProposedDoors, added: list[int]) -> None:
    from semmap_log.interop.importing.door_proposing import name_of
    from semmap_log.views.join_table import proposal_to_json

    print_json({
        "file": str(file), "scans": found.scans, "source": found.source,
        "proposals": [
            proposal_to_json(number, each, name_of(each))
            for number, each in enumerate(found.proposals, start=1)
        ],
        "added": added,
    })  # fmt: skip


def _tell(
    command: str, file: Path, found: ProposedDoors, added: list[int], asked: Proposing
) -> None:
    from semmap_log.views.join_table import proposal_table

    if found.proposals:
        several = len({each.level for each in found.proposals}) > 1
        console().print(proposal_table(found.proposals, show_level=several))
    by = "the floor plan's walls" if found.walls else "walls that the scans draw (no floor plan)"
    count = counted(len(found.proposals), "proposal")
    say(f"{file}: {counted(found.scans, 'scan')}, {by}: {count}.")
    say("  A door that was shut all the time looks like wall, and is not proposed.")
    if asked.plot is not None:
        say(f"  drawn: {asked.plot}")
    if added:
        ids = ", ".join(map(str, added))
        say(f"  added {counted(len(added), 'door')}: {ids} (source {found.source})")
    elif found.proposals:
        look = "" if asked.plot is not None else " Look at them (--plot doors.png)."
        say(f"  Nothing was added.{look} To add all of them: {command}; some: --only N, too")
