r"""What verbs write to a terminal never controls it, whoever wrote the text.

A name in a foreign file (a door's, a topic's, the file's own) may contain escape sequences. So
inside of `plain_streams` all that is written to stdout and stderr has such characters spelt out,
`\x1b`, and so has what rich draws by `PlainConsole`; its own colours go to the stream beneath. In
JSON they are JSON's escapes (`json_text`), so that programs read the exact text.

Shell completion is here, too: doors, levels, states and kinds of events. It only reads, and offers
nothing where the log cannot be read, since the user is in the middle of typing.

Values of a command line that need no library (texts, paths, numbers, and what is not given) are
parsed here. From 0.29 on, typer has pydantic read the value of every option, also of those that are
not given. Loading pydantic takes as long as replaying a small log. Choices, lists and errors are
still left to it.
"""

from __future__ import annotations

import json
import os
import re
import select
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from semmap_log.core.lazily import late_pattern

if TYPE_CHECKING:
    from semmap_log.core.model.doors import DoorMap


READER_GONE = 141
"""Exit code where the reader of our output has gone, as `head` does: as of any program that SIGPIPE
ends."""


def is_for_people() -> bool:
    """Return whether a terminal shows what is printed on stdout."""
    return sys.stdout.isatty()


def plain(text: str) -> str:
    """Return a text with all but its line ends spelt out that is not to be seen."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


def json_text(value: Any, *, indent: int | None = None) -> str:
    """Return a value as JSON that a terminal shows as it is, and a program reads exactly."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, indent=indent)
    if text.isascii() and "\x7f" not in text:
        return text
    return "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text)


class PlainStream:
    """A stream for text whose writer cannot be trusted."""

    def __init__(self, beneath: TextIO) -> None:
        self.beneath = beneath
        self.has_begun = False
        """Whether anything was written."""

    def write(self, text: str) -> int:
        """Write it, plain."""
        self.has_begun = True
        self.beneath.write(plain(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write them, plain."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        if name == "buffer":
            raise AttributeError("bytes would pass by; what has to, goes to the stream beneath")
        return getattr(self.beneath, name)


def steering(stream: TextIO) -> TextIO:
    """Return the stream beneath, for what steers the terminal on purpose."""
    return stream.beneath if isinstance(stream, PlainStream) else stream


def write_line(line: str) -> None:
    """Write a line on stdout whose texts are plain already: its tabs stay tabs."""
    stream = sys.stdout
    if isinstance(stream, PlainStream):
        stream.has_begun = True
    steering(stream).write(f"{line}\n")


@contextmanager
def plain_streams() -> Iterator[None]:
    """Let all that is written within be plain."""
    before = sys.stdout, sys.stderr
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if not isinstance(stream, PlainStream):
            setattr(sys, name, PlainStream(stream))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def forget_output() -> None:
    """Let go of what stdout still holds: at exit it would be written, and fail, once more.

    What can be written is: it may be stderr that failed.
    """
    with suppress(OSError):
        sys.stdout.flush()
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def is_nobody_reading() -> bool:
    """Return whether the reader of our output has gone, which nothing shows without output."""
    try:
        output = sys.stdout.fileno()
    except (OSError, ValueError):
        return False  # not a file, as in tests
    if not hasattr(select, "poll"):
        return False  # Windows: the next line that is written says so
    poll = select.poll()
    poll.register(output, 0)
    return any(events & (select.POLLERR | select.POLLHUP) for _, events in poll.poll(0))


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
    import semmap_log as sl

    with suppress(Exception), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield sl.read(log).replay()


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


def with_plain_readers(params: list[Any]) -> list[Any]:
    """Return typer's options and arguments, which now read plain values without pydantic.

    Those of a typer that has no pydantic are left as they are.
    """
    for param in params:
        reader = getattr(param, "get_runtime_param", None)
        if reader is not None and not isinstance(reader, partial):
            param.get_runtime_param = partial(_PlainReader, param.type_descriptor, reader)
    return params


_NUMBER: dict[Any, re.Pattern[str]] = {
    int: re.compile(r"-?\d{1,15}", re.ASCII),
    float: re.compile(r"-?\d{1,15}(\.\d+)?", re.ASCII),
}
"""How a number is written plainly; in other ways it is typer's to read."""


class _PlainReader:
    """Stands where typer has what reads a value."""

    def __init__(self, described: Any, others: Callable[[], Any]) -> None:
        self._about = described.parameter_info
        self._kind: Any = described.annotation if self._about.parser is None else None
        self._others = others

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return the value that was meant; what typer says of it where that is not plain."""
        is_one = not param.multiple and param.nargs != -1
        if value is None:
            return None if is_one else ()
        if is_one and type(value) is self._kind is not str:  # as the verb has it by default
            return value
        if is_one and type(value) is str and self._is_plain(value):
            return self._kind(value)
        return self._others().coerce(value, param=param, ctx=ctx)

    def _is_plain(self, text: str) -> bool:
        if self._kind is Path:  # not there, or can be read: else typer has something to say
            return not os.path.exists(text) or os.access(text, os.R_OK)  # noqa: PTH110
        if self._kind in _NUMBER and _NUMBER[self._kind].fullmatch(text):
            low, high = self._about.min, self._about.max
            return (low is None or float(text) >= low) and (high is None or float(text) <= high)
        return self._kind is str
