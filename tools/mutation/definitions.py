"""Where a module, class, function or constant is defined, found by its name alone.

A name is the end of a dotted path, as long as needed to name only one: `replay`, `LogFolder.open`,
`HOLDS_NS`, or, where two modules define the same, `closed_mark._digest`. So nothing that is named
here needs to be told when a file moves to another folder.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_DEFINES = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


class OutOfDateError(Exception):
    """The program has no such thing, or several."""


@dataclass(frozen=True, slots=True)
class Definition:
    """What a name stands for."""

    path: Path
    """The file, with the folder that was searched in front."""
    steps: tuple[str, ...]
    """The dotted path of what is defined, from the folder on."""
    inside: tuple[str, ...]
    """The part of it that lies in the file; empty for a module."""
    nodes: tuple[ast.AST, ...]
    """More than one for a property and its setter, or overloads."""


class Definitions:
    """The definitions of all Python files of a folder; each file is parsed when a name needs it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._texts = {path: path.read_bytes() for path in sorted(folder.rglob("*.py"))}
        self._words = {path: _words_of(path, text) for path, text in self._texts.items()}
        self._parsed: dict[Path, list[Definition]] = {}

    def named(self, name: str) -> Definition:
        """Return the one definition whose dotted path ends so.

        Raises:
            OutOfDateError: There is none, or several.
        """
        steps = tuple(name.split("."))
        found = [
            definition
            for path, words in self._words.items()
            if steps[-1] in words
            for definition in self._of(path)
            if definition.steps[-len(steps) :] == steps
        ]
        if len(found) != 1:
            paths = ", ".join(".".join(definition.steps) for definition in found)
            raise OutOfDateError(f"expected one definition of {name!r}, found "
                                 f"{len(found)}{': ' if paths else ''}{paths}")  # fmt: skip
        return found[0]

    def _of(self, path: Path) -> list[Definition]:
        if path not in self._parsed:
            self._parsed[path] = list(_definitions(self._folder, path, self._texts[path]))
        return self._parsed[path]


def _words_of(path: Path, text: bytes) -> set[str]:
    """Return all that a file may define."""
    return {path.stem, path.parent.name, *re.findall(r"\w+", text.decode())}


def _definitions(folder: Path, path: Path, text: bytes) -> Iterator[Definition]:
    module = path.relative_to(folder.parent).with_suffix("").parts
    module = module[:-1] if module[-1] == "__init__" else module
    found: dict[tuple[str, ...], list[ast.AST]] = {}
    for inside, node in _named((), ast.parse(text)):
        found.setdefault(inside, []).append(node)
    for inside, nodes in found.items():
        yield Definition(path, module + inside, inside, tuple(nodes))


def _named(name: tuple[str, ...], node: ast.AST) -> Iterator[tuple[tuple[str, ...], ast.AST]]:
    """Yield a module, class or function and all that is defined in it."""
    yield name, node
    for child in _children(node):
        if isinstance(child, _DEFINES):
            yield from _named((*name, child.name), child)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            for constant in _assigned(child):
                yield (*name, constant), child


def _children(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what stands in a block, and in the blocks of its `if`, `with` and `try`."""
    for child in ast.iter_child_nodes(node):
        yield child
        if isinstance(child, ast.stmt | ast.excepthandler) and not isinstance(child, _DEFINES):
            yield from _children(child)


def _assigned(statement: ast.AST) -> Iterator[str]:
    """Yield the names that a statement of a module or class gives a value."""
    targets: list[ast.expr] = []
    if isinstance(statement, ast.Assign):
        targets = statement.targets
    elif isinstance(statement, ast.AnnAssign):
        targets = [statement.target]
    for target in targets:
        for each in target.elts if isinstance(target, ast.Tuple) else [target]:
            if isinstance(each, ast.Name):
                yield each.id
