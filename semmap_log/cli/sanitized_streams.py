r"""What verbs write to a terminal never controls it, whoever wrote the text.

A name in a foreign file (a door's, a topic's, the file's own) may contain escape sequences. So
inside of `sanitized_streams` all that is written to stdout and stderr has such characters spelt
out, `\x1b`, and so has what rich draws by `PlainConsole`; its own colours go to the stream
beneath. In JSON they are JSON's escapes (`json_text`), so that programs read the exact text.
"""

from __future__ import annotations

import json
import os
import select
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

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
def sanitized_streams() -> Iterator[None]:
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
