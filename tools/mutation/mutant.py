"""A program with one guard taken out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Mutant:
    """One snippet of one file, and what stands there instead."""

    name: str
    """Which guard is missing, in words."""
    file: str
    """Its path in the checkout."""
    snippet: str
    """What is replaced; it must occur exactly once, or the list is out of date."""
    replacement: str
    tests: tuple[str, ...]
    """Files or ids of tests, the quickest first, one of which must fail."""

    def problem(self, root: Path) -> str:
        """Return why the mutant cannot be made; empty if it can."""
        try:
            found = (root / self.file).read_text(encoding="utf-8").count(self.snippet)
        except OSError as error:
            return f"{self.name}: {self.file}: {error.strerror}"
        if found != 1:
            return f"{self.name}: {self.file}: expected the snippet once, found it {found} times"
        missing = [test for test in self.tests if not (root / test.partition("::")[0]).exists()]
        return f"{self.name}: there is no {missing[0]}" if missing else ""

    def apply(self, tree: Path) -> None:
        """Take the guard out of a copy of the checkout."""
        path = tree / self.file
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace(self.snippet, self.replacement), encoding="utf-8")


class MakeMutant(Protocol):
    """Makes the mutants of one room."""

    def __call__(self, name: str, file: str, snippet: str, put: str, *tests: str) -> Mutant:
        """Return the mutant of a file of the room; see `Mutant`."""


def mutants_in(room: str, part: str = "") -> MakeMutant:
    """Return what makes the mutants of one room.

    Args:
        room: The folder of their files, such as `semmap_log/live/`.
        part: What their names begin with, so that a word chooses them all.
    """

    def make(name: str, file: str, snippet: str, put: str, *tests: str) -> Mutant:
        return Mutant(part + name, room + file, snippet, put, tests)

    return make
