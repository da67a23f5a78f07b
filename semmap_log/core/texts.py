"""Texts of messages: counts, command lines to paste, and repeats that are shown once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePath

from semmap_log.core.lazily import late_pattern


def counted(number: int, what: str) -> str:
    """Return how many of a thing: `1 event`, `2,000 events`."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def percent(share: float) -> str:
    """Return a share in percent: `90%`; what is not quite all does not look so: `99.6%`."""
    digits = 0
    while share < 1 and float(f"{share * 100:.{digits}f}") >= 100:
        digits += 1
    return f"{share * 100:.{digits}f}%"


PROGRAM = "semmap-log"


def command_line(verb: str, *words: str | PurePath, program: str = PROGRAM) -> str:
    """Return a line that runs a verb; paths and words are quoted where a shell needs it.

    Words in capitals, such as DOOR, stand for what the reader fills in.

    Args:
        verb: Such as `recover`.
        *words: Its arguments and options; a path that begins like an option is written so that it
            is none.
        program: What runs it.
    """
    import shlex

    said = [_path(word) if isinstance(word, PurePath) else word for word in words]
    return shlex.join([program, verb, *said])


def _path(path: PurePath) -> str:
    text = str(path)
    return f"./{text}" if text.startswith("-") else text


MOST_CHARACTERS = 2000
"""Of a message, however long the texts in it are."""


def brief(text: str) -> str:
    """Return a message, cut if it is longer than anybody reads."""
    return text if len(text) <= MOST_CHARACTERS else f"{text[: MOST_CHARACTERS - 1]}…"


MOST_KEPT = 20
"""So many of a kind are kept."""
MOST_LISTED = 3
"""So many of a kind are shown where there are many."""


@dataclass(slots=True)
class Kind:
    """Texts that are the same but for the values in them."""

    kept: list[tuple[int, str]] = field(default_factory=list)
    """The first ones: line and text."""
    count: int = 0
    last_line: int = 0

    def rest(self) -> list[str]:
        """Return in words how many more there are than are shown; nothing if there are none."""
        more = self.count - MOST_LISTED
        last = f", the last on line {self.last_line}" if self.last_line else ""
        return [f"… and {more:,} more like that{last}"] * (more > 0)


@dataclass(slots=True)
class Repeats:
    """Messages about lines, grouped by kind: memory grows with the kinds, not with the lines."""

    _kinds: dict[str, Kind] = field(default_factory=dict)

    def add(self, line: int, text: str) -> Kind:
        """Count a text, and keep it if it is one of the first of its kind; return the kind.

        Args:
            line: Where, 1-based; 0: on none.
            text: The message about it; what is longer than anybody reads is cut.
        """
        text = brief(text)
        kind = self._kinds.setdefault(_without_values(text), Kind())
        kind.count += 1
        kind.last_line = max(kind.last_line, line)
        if len(kind.kept) < MOST_KEPT:
            kind.kept.append((line, text))
        return kind

    def __len__(self) -> int:
        return len(self._kinds)

    def __iter__(self) -> Iterator[Kind]:
        """Yield the kinds by their first lines."""
        return iter(sorted(self._kinds.values(), key=lambda kind: kind.kept[0][0]))

    @property
    def count(self) -> int:
        """How many texts there were."""
        return sum(kind.count for kind in self._kinds.values())


_VALUES = late_pattern(r"'(?:[^'\\]|\\.)*'?|\"(?:[^\"\\]|\\.)*\"?|\d[\w.:+-]*")
"""What is quoted, to its end or to where it was cut, and what begins with a digit."""


def _without_values(text: str) -> str:
    return _VALUES.sub("…", text)


def deduplicated(texts: Iterable[str]) -> Iterator[str]:
    """Yield texts; of those that are the same but for their values the first ones and a count."""
    found = Repeats()
    for text in texts:
        found.add(0, text)
    for kind in found:
        yield from (text for _, text in kind.kept[:MOST_LISTED])
        yield from kind.rest()
