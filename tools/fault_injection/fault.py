"""The words that all kinds of faults share, and folders as values."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Plan:
    """What a kind is asked to do. It yields an `Outcome` for each fault, until nobody asks."""

    seed: int
    """Everything that is drawn comes from it, so that a run can be repeated."""
    folder: Path
    """An empty folder for its logs, in memory if there is such a place; removed afterwards."""
    faults: int | None = None
    """How many faults are wanted, spread over all that the kind has; None: all of them."""
    keep: Path = Path("faults_found")
    """Where a log on which something went wrong is kept."""
    only: int | None = None
    """Try the fault of that number alone, as its outcome names it; for kinds that number theirs."""

    def most(self, usual: int) -> int:
        """Return how many faults to try, for a kind that could go on for ever."""
        return usual if self.faults is None else self.faults

    def turns(self, usual: int, share: int, shares: int) -> Iterator[int]:
        """Yield the numbers of the faults that one of some processes tries.

        Args:
            usual: How many there are if nobody says.
            share: Which of the processes.
            shares: How many they are.
        """
        if self.only is None:
            yield from range(share, self.most(usual), shares)
        elif share == 0:
            yield self.only


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of the log under one fault."""

    fault: str
    """What was done, in words with which it can be done again."""
    checked: int = 0
    """Acknowledged commits that were looked for."""
    lost: int = 0
    """Of them, those that are not there, or not as they were."""
    invented: int = 0
    """Commits that are there and that nobody asked for, or twice, or altered."""
    problem: str = ""
    """What else is wrong: it does not open, a promise was broken; or more on what was lost."""
    kept: Path | None = None
    """Where the log is kept as the fault left it."""

    @property
    def is_good(self) -> bool:
        """Whether nothing was lost or invented, and every promise was kept."""
        return not (self.lost or self.invented or self.problem)


class CannotTryError(Exception):
    """This machine lacks what a kind of fault needs; the message says what. It is said aloud."""


Kind = Callable[[Plan], Generator[Outcome, None, None]]
"""A kind of fault. When it is given up early (`close()`), it must end all that it started.

A kind that has an end yields its faults in an order drawn from the seed, so that the first
hundred are a sample of all.
"""


Tree: TypeAlias = "Mapping[str, bytes | Tree]"
"""A folder's content: name -> a file's bytes, or a folder."""


def read_tree(folder: Path) -> Tree:
    """Return what is in a folder."""
    return {
        path.name: read_tree(path) if path.is_dir() else path.read_bytes()
        for path in folder.iterdir()
    }


def write_tree(folder: Path, tree: Tree) -> None:
    """Make a folder of that content, in place of any that is there."""
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    for name, content in tree.items():
        if isinstance(content, bytes):
            (folder / name).write_bytes(content)
        else:
            write_tree(folder / name, content)


def keep(folder: Path, fault: str, tree: Tree) -> Path:
    """Put a content into a subfolder named after the fault that left it, and return that."""
    kept = folder.resolve() / hashlib.sha256(fault.encode()).hexdigest()[:12]
    write_tree(kept, tree)
    (kept / "fault.txt").write_text(fault + "\n")
    return kept
