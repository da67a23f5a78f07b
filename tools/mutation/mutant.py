"""A program with one guard taken out.

A guard is told in three short things: the name of the function, class or constant that it stands
in, the piece of Python that it is, and what stands there instead (nothing: it is left out).

    guard("sync of a commit", "LiveSegment.sync", "os.fdatasync(self._fd)", "", "test_writer")

Behind them stand the tests that notice, by name. How the piece is laid out, and in which folder
its file lies, and those of its tests, makes no difference.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

from mutation import pieces
from mutation.definitions import Definition, Definitions, OutOfDateError

PACKAGE = "semmap_log"
TOOLS = {name: f"tools/{name}" for name in ("navigation", "patrol_eval", "door_eval", "door_peers")}
"""What else has guards: their names begin with the first word."""


class Checkout:
    """A folder with the package, tools and tests."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._package = Definitions(root / PACKAGE)
        self._tools = {name: Definitions(root / folder) for name, folder in TOOLS.items()}
        self.tests = Definitions(root / "tests")

    def named(self, name: str) -> Definition:
        """Return what a guard stands in.

        Raises:
            OutOfDateError: There is none of that name, or several.
        """
        return self._tools.get(name.partition(".")[0], self._package).named(name)

    def test_id(self, name: str) -> str:
        """Return what pytest calls a test module, or a test in one.

        Raises:
            OutOfDateError: There is none of that name, or several.
        """
        test = self.tests.named(name)
        return "::".join((test.path.relative_to(self.root).as_posix(), *test.inside))


@dataclass(frozen=True, slots=True)
class Mutant:
    """One piece of one definition, and what stands there instead."""

    name: str
    """Which guard is missing, in words."""
    where: str
    """What it stands in: see `mutation.definitions`; or a file that is not Python, as `plan.js`."""
    piece: str
    """An expression, or one or more statements one behind the other; it stands there once."""
    replacement: str
    """What is there instead; empty: nothing."""
    tests: tuple[str, ...]
    """Names of test modules, or of tests, the quickest first, one of which must fail."""

    def problem(self, checkout: Checkout) -> str:
        """Return why the mutant cannot be made, or tested; empty if it can."""
        try:
            path, mutated = self._made(checkout)
            if path.suffix == ".py":
                ast.parse(mutated)
            for test in self.tests:
                checkout.test_id(test)
        except (OutOfDateError, SyntaxError) as error:
            return f"{self.name}: {self.where}: {error}"
        same = mutated == path.read_bytes()
        return f"{self.name}: {self.where}: what replaces it is the same" if same else ""

    def apply(self, checkout: Checkout) -> None:
        """Take the guard out.

        Raises:
            OutOfDateError: It is not there, or not once.
        """
        path, mutated = self._made(checkout)
        path.write_bytes(mutated)

    def _made(self, checkout: Checkout) -> tuple[Path, bytes]:
        """Return the file that is another one without the guard, and its bytes then."""
        if self.where.endswith((".js", ".c")):
            return self._made_of_text(checkout.root / PACKAGE)
        definition = checkout.named(self.where)
        place = pieces.find(definition, self.piece, self.replacement)
        return definition.path, place.put(definition.path.read_bytes())

    def _made_of_text(self, package: Path) -> tuple[Path, bytes]:
        paths = list(package.rglob(self.where))
        if len(paths) != 1:
            raise OutOfDateError(f"expected one file of that name, found {len(paths)}")
        text = paths[0].read_text(encoding="utf-8")
        if text.count(self.piece) != 1:
            found = text.count(self.piece)
            raise OutOfDateError(f"expected {self.piece!r} once, found it {found} times")
        return paths[0], text.replace(self.piece, self.replacement).encode()


def guard(name: str, where: str, piece: str, put: str, *tests: str) -> Mutant:
    """Return the mutant without a guard; see `Mutant`."""
    return Mutant(name, where, piece, put, tests)
