"""`--ship` of the verbs that write for long: the log is sent to a store meanwhile."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import a_url, say
from semmap_log.cli.failures import tell
from semmap_log.cli.told_at_end import told_at_end
from semmap_log.core.texts import command_line

if TYPE_CHECKING:
    from semmap_log.fleet.ship_beside import ShipBeside


def _checked(text: str | None) -> str | None:
    """Return the URL that was given.

    Raises:
        typer.BadParameter: It is none.
    """
    return None if text is None else str(a_url(text))


ShipTo = Annotated[
    str | None,
    typer.Option(
        "--ship",
        metavar="URL",
        help="Send each segment there once it is closed, as `ship` does.",
        callback=_checked,
    ),
]


def shipped_beside(log: Path, url: str | None) -> AbstractContextManager[None]:
    """Return what ships a log while it is written, and once more when its writer has ended.

    Args:
        log: Its folder.
        url: Where to; None: nothing is shipped.

    Raises:
        MissingExtraError: A package for stores is not installed.
        LogAccessError: The environment names no store that can be asked.
    """
    if url is None:
        return nullcontext()
    from semmap_log.fleet.ship_beside import ShipBeside

    beside = ShipBeside(log, a_url(url), tell=tell)
    return told_at_end(beside, lambda: _say_how_far(log, beside))


def _say_how_far(log: Path, beside: ShipBeside) -> None:
    status = beside.status
    if status.is_all_sent and status.shipped is not None:
        done = status.shipped
        say(f"{done.url}: shipped up to event {done.manifest.mark.next_event - 1}.")
    else:
        why = "" if status.problem else ": the end does not wait for it any longer"  # that was told
        tell(f"not all is shipped{why}. To send it: {command_line('ship', log, beside.url)}")
