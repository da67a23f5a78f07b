"""Functions with one change each, made by cosmic-ray, and chosen by a seed."""

from __future__ import annotations

import ast
import difflib
import hashlib
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Function:
    """A function or method of the package, without its decorators."""

    path: Path
    name: str
    before: str
    """The file up to its first line."""
    text: str
    after: str
    statements: int
    digest: str
    """Hash of its code without the docstring."""

    def above(self) -> str:
        """Return what makes it Python by itself: a method needs a class."""
        return "class _:\n" * self.text.startswith(" ")


@dataclass(frozen=True)
class Mutant:
    """A function with one change."""

    function: Function
    operator: str
    occurrence: int
    """Which of the places in the function that the operator can change."""

    @property
    def key(self) -> str:
        """Its name in the list of survivors."""
        return f"{self.function.digest}/{self.operator}/{self.occurrence}"

    def text(self) -> str:
        """Return the changed function."""
        from cosmic_ray.mutating import mutate_code

        above = self.function.above()
        operator = _operators()[self.operator]
        code = mutate_code(above + self.function.text, operator, self.occurrence)
        return str(code).removeprefix(above)

    def change(self) -> list[str]:
        """Return the lines that differ."""
        lines = difflib.ndiff(self.function.text.splitlines(), self.text().splitlines())
        return [f"{line[0]} {line[2:].strip()}" for line in lines if line[0] in "+-"]


def functions_of(path: Path) -> Iterator[Function]:
    """Yield the functions and methods of a file; those inside a function belong to it."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines(keepends=True)
    found: list[tuple[str, ast.AST]] = [("", ast.parse(text))]
    for prefix, parent in found:
        for node in ast.iter_child_nodes(parent):
            if isinstance(node, ast.ClassDef):
                found.append((f"{prefix}{node.name}.", node))
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                ends = [0, node.lineno - 1, node.end_lineno, None]
                parts = ["".join(lines[slice(*ends[at : at + 2])]) for at in range(3)]
                node.decorator_list = []
                node.body = node.body[ast.get_docstring(node) is not None :]
                digest = hashlib.sha256(ast.unparse(node).encode()).hexdigest()[:16]
                statements = sum(isinstance(each, ast.stmt) for each in ast.walk(node)) - 1
                yield Function(path, prefix + node.name, *parts, statements, digest)


def chosen(
    functions: Sequence[Function], count: int, seed: int, only: str | None = None
) -> list[Mutant]:
    """Return mutants at `count` places, the more in a function the longer it is.

    What is chosen in a function depends on the seed and on its code alone, so a seed tries the same
    mutants until their functions change.
    """
    if only:
        near = [each for each in functions if only.startswith(each.digest)]
        found = [mutant for each in near for _, mutant in mutants_of(each) if mutant.key == only]
        return found[:1] or sys.exit(f"{only}: expected one mutant of this name, found 0")
    draws = [(each, turn) for each in functions for turn in range(2 * each.statements)]
    draws.sort(key=lambda draw: _rank(seed, draw[0].digest, draw[1]))
    waiting: dict[tuple[Path, str], list[Mutant]] = {}
    found = []
    for function, _ in draws:
        name = function.path, function.name
        if len(found) < count:
            waiting[name] = waiting[name] if name in waiting else _one_a_place(function, seed)
            found += [waiting[name].pop()] if waiting[name] else []
    return found


def _one_a_place(function: Function, seed: int) -> list[Mutant]:
    made = sorted(mutants_of(function), key=lambda each: _rank(seed, each[1].key))
    return list(dict(made).values())


def _rank(*parts: object) -> bytes:
    return hashlib.sha256(repr(parts).encode()).digest()


class LeaveOutCall:
    """An operator like those of cosmic-ray: a statement that only calls becomes `pass`."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[object, object]]:
        """Yield where a node can be changed."""
        if (
            node.type in {"atom_expr", "power"}
            and node.parent.type == "simple_stmt"
            and node.children[-1].get_first_leaf() == "("
        ):
            yield node.start_pos, node.end_pos

    def mutate(self, node: Any, _: int) -> Any:
        """Return what replaces the node."""
        from parso.python.tree import Keyword

        return Keyword("pass", node.start_pos, node.get_first_leaf().prefix)


def mutants_of(function: Function) -> Iterator[tuple[object, Mutant]]:
    """Yield all mutants of a function, each with its place; annotations are left alone."""
    from cosmic_ray.ast import ast_nodes, get_ast

    nodes = list(ast_nodes(get_ast(function.above() + function.text)))
    for name, operator in _operators().items():
        places = [(node, place) for node in nodes for place in operator.mutation_positions(node)]
        for occurrence, (node, place) in enumerate(places):
            if not _is_annotation(node):
                yield place, Mutant(function, name, occurrence)


@cache
def _operators() -> dict[str, Any]:
    from cosmic_ray.plugins import get_operator, operator_names

    classes = {name.partition("/")[2]: get_operator(name) for name in operator_names()}
    simple = {name: each() for name, each in classes.items() if not each.arguments()}
    return {**simple, "LeaveOutCall": LeaveOutCall()}


def _is_annotation(node: Any) -> bool:
    while (parent := node.parent) is not None:
        match parent.type:
            case "tfpdef" if node is parent.children[2]:
                return True
            case "annassign" if node is parent.children[1]:
                return True
            case "funcdef" if node is parent.annotation:
                return True
        node = parent
    return False
