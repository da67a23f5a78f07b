"""`retract`: events are taken back."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, WritableLog, console, say, takes_about
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.core.folds.history import HistoryEntry
    from semmap_log.log import About, DoorLog

MOST_SHOWN = 20


@takes_about
def run(
    log: WritableLog,
    events: Annotated[
        str, typer.Argument(metavar="N[..M]", help="An event's number; or the first and last.")
    ],
    *,
    as_json: AsJson = False,
    about: About,
) -> None:
    """Take events back: every answer leaves them out from now on.

    They stay in the log: --known-at before this still shows them, `history` marks them. It cannot
    itself be retracted. A door whose adding is retracted is gone, and its id is not used again; one
    whose removal is retracted is back, under its id.

    \b
    Examples:
      semmap-log retract office 58 --actor porter --reason "sun on the glass"
      semmap-log retract office 120..131 --reason "dirty lens"
    """
    from semmap_log.cli.door_options import tell
    from semmap_log.log import append, newly_hidden, read

    first, last = _range(events)
    with append(log) as opened:
        appended = opened.retract(first, last, **about)
    after = read(log)
    hidden = newly_hidden(after, appended.first_event)
    if as_json:
        from semmap_log.interop.formats.json.door_json import entry_to_json

        entries = [entry_to_json(entry) for entry in hidden]
        tell(appended, as_json=True, first_event=first, last_event=last, hidden=entries)
        return
    tell(appended, as_json=False)
    _show(after, hidden)
    _say_what_stays(after, first, last)


def _range(text: str) -> tuple[int, int]:
    """Return the numbers of `58`, `event:58`, `58..60` or `event:58..event:60`."""
    found = re.fullmatch(r"(?:event:)?(\d{1,18})(?:\.\.(?:event:)?(\d{1,18}))?", text)
    if found is None:
        raise typer.BadParameter(
            f"{text!r}: expected an event's number such as 58, or a range such as 58..60",
            param_hint="N[..M]",
        )
    return int(found[1]), int(found[2] or found[1])


def _show(log: DoorLog, hidden: Iterator[HistoryEntry]) -> None:
    """Print what was hidden, as `history` does; that it was need not stand in each line."""
    from semmap_log.views.tables import history_table

    shown = [replace(entry, retracted=False) for entry in islice(hidden, MOST_SHOWN)]
    more = sum(1 for _ in hidden)
    typer.echo(f"hides {counted(len(shown) + more, 'event')}:")
    out = console()
    names, objects = log.door_names(), log.objects()
    out.print(history_table(shown, tz=log.info.timezone, names=names, objects=objects))
    if more:
        typer.echo(f"… and {more:,} more (all: --json, or `history`)")


def _say_what_stays(log: DoorLog, first: int, last: int) -> None:
    """Say so where a commit, which came whole, was taken back in part."""
    for number in (first, last):
        commit = log.find_commit(number)
        if commit is not None and not (first <= commit.first_event and commit.last_event <= last):
            whole = f"{commit.first_event}..{commit.last_event}"
            say(f"note: of the commit of events {whole}, the others stay.")
            return
