"""Shell completion: doors, levels, states and kinds of events.

It only reads, and offers nothing where the log cannot be read, since the user is in the middle of
typing.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from semmap_log.core.lazily import late_pattern

if TYPE_CHECKING:
    from semmap_log.core.model.doors import DoorMap


Offers = list[tuple[str, str]]
"""Each a word, and what it means, for shells that show it."""


_NEEDS_NO_QUOTES = late_pattern(r"[\w./+@%,=-]+")


def doors(ctx: Any, incomplete: str) -> Offers:
    """Offer the doors of the log: by name; by id where the name would have to be quoted."""
    return _beginning(incomplete, (offer for known in _map(ctx) for offer in _doors(known)))


def levels(ctx: Any, incomplete: str) -> Offers:
    """Offer the levels of the log: by name, or by number."""
    return _beginning(incomplete, (offer for known in _map(ctx) for offer in _levels(known)))


def states(_: Any, incomplete: str) -> Offers:
    """Offer the states of a door, in the letters that were begun with."""
    from semmap_log.core.model.doors import DoorState

    names = (state.name for state in DoorState)
    if not incomplete.isupper():
        names = (name.lower() for name in names)
    return _beginning(incomplete, ((name, "") for name in names))


def kinds(_: Any, incomplete: str) -> Offers:
    """Offer the kinds of events."""
    from semmap_log.core.model.events import KINDS

    said = ((kind.__name__, (kind.__doc__ or "").splitlines()[0]) for kind in KINDS)
    return _beginning(incomplete, said)


def _map(ctx: Any) -> Iterator[DoorMap]:
    """Yield the door map of the log that is on the command line, if it can be read.

    After an option whose value is still to come, words are not yet parsed: then the log is the
    first of them.
    """
    log = ctx.params.get("log") or next(iter(ctx.args), None)
    if log is None:
        return
    from semmap_log.log import read

    with suppress(Exception), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield read(log).replay()


def _doors(door_map: DoorMap) -> Iterator[tuple[str, str]]:
    names = [door.name for door in door_map.doors.values()]
    for door in door_map.doors.values():
        level = door_map.level_name(door.level)
        name = door.name or ""
        if names.count(name) > 1 and level:
            name = f"{level}/{name}"
        if _NEEDS_NO_QUOTES.fullmatch(name) and not name.isdecimal():
            yield name, f"door {door.door_id}"
        else:
            yield str(door.door_id), name


def _levels(door_map: DoorMap) -> Iterator[tuple[str, str]]:
    numbers = {door.level for door in door_map.doors.values()} | {*door_map.levels}
    for number in sorted(numbers):
        name = door_map.level_name(number)
        if _NEEDS_NO_QUOTES.fullmatch(name) and name != str(number):
            yield name, f"level {number}"
        else:
            yield str(number), name


def _beginning(incomplete: str, offers: Iterator[tuple[str, str]]) -> Offers:
    return [(word, said) for word, said in offers if word.startswith(incomplete)]


OFFERS: dict[str, Callable[[Any, str], Offers]] = {
    "door": doors, "doors": doors, "level": levels, "state": states, "kind": kinds,
}  # fmt: skip
"""Name of an argument or option -> what is offered for it, whatever the verb."""
