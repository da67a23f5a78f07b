"""All problems of a file, collected with their lines, so that one run shows every one of them."""

from __future__ import annotations

from pathlib import Path

from semmap_log.core.texts import Repeats
from semmap_log.errors import FormatError

MOST_KINDS = 1_000
"""More than anybody reads, few enough that a wrong file of a million lines needs no memory."""
MOST_PROBLEMS = 50_000
"""A file with so many is another than it was taken for: it is not worth reading on."""


class Problems:
    """What is wrong with a file, by kind: the first lines of each, and how many there are."""

    def __init__(self, path: Path | str) -> None:
        self.path = path
        self.found = Repeats()
        self._count = 0

    def add(self, line: int, text: str) -> None:
        """Note that `text` is wrong on `line` (1-based)."""
        self.found.add(line, text)
        self._count += 1

    @property
    def is_full(self) -> bool:
        """True once it is not worth reading on."""
        return len(self.found) >= MOST_KINDS or self._count >= MOST_PROBLEMS

    def raise_any(self) -> None:
        """Raise what was found.

        Raises:
            FormatError: Something was; problems in order of their lines.
        """
        if self.found:
            raise FormatError(self.path, self.found)

    def with_last(self, line: int, text: str) -> FormatError:
        """Return what was found, and what made an end of reading, as an error to raise."""
        self.add(line, text)
        return FormatError(self.path, self.found)


def shown(value: object, *, most: int = 60) -> str:
    """Return the value as a message shows it: on one line, and cut where it is long."""
    text = repr(value)
    return text if len(text) <= most else text[: most - 1] + "…"
