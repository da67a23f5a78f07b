"""Where a piece of Python stands in a definition, found by its syntax.

Blanks, quotes, comments, brackets and line breaks make no difference. A piece is

- an expression: `len(data) > MOST_BYTES`;
- a keyword of a call: `sync=False`;
- the head of a block: `if self._is_open:`, `with self._lock:`;
- one or more statements, one behind the other.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

from mutation.definitions import Definition, OutOfDateError

_Block = ast.If | ast.While | ast.For | ast.With
_BLOCKS = ("body", "orelse", "finalbody")


@dataclass(frozen=True, slots=True)
class Place:
    """Bytes of a file, and what stands there instead."""

    start: int
    end: int
    replacement: str

    def put(self, text: bytes) -> bytes:
        """Return the file with the replacement in its place."""
        return text[: self.start] + self.replacement.encode() + text[self.end :]


def find(definition: Definition, piece: str, replacement: str) -> Place:
    """Return where the piece stands, and how the replacement is written there.

    Args:
        definition: What it stands in.
        piece: See above.
        replacement: A piece of the same form. What is no expression replaces whole statements;
            nothing leaves statements, or a keyword, out.

    Raises:
        OutOfDateError: It does not stand there once, or one of the two is no Python.
    """
    source = _Source(definition)
    if piece.endswith(":"):
        (head,) = _parsed(f"{piece} pass")
        found = list(source.heads(head, replacement))
    else:
        found = list(source.pieces(_parsed(piece), replacement))
    if len(found) != 1:
        raise OutOfDateError(f"expected {piece!r} once, found it {len(found)} times")
    return found[0]


def _parsed(piece: str) -> list[ast.stmt]:
    try:
        return ast.parse(piece).body
    except SyntaxError as error:
        raise OutOfDateError(f"{piece!r} is no Python: {error.msg}") from error


class _Source:
    """A definition, and the bytes of its file."""

    def __init__(self, definition: Definition) -> None:
        self._definition = definition
        self._text = definition.path.read_bytes()

    def pieces(self, wanted: list[ast.stmt], replacement: str) -> Iterator[Place]:
        match wanted, _parsed(replacement):
            case [ast.Expr(value)], [ast.Expr()]:
                yield from self._expressions(value, replacement)
            case [ast.Assign([ast.Name(name)], value)], ([] | [ast.Assign([ast.Name()])]):
                yield from self._keywords(name, value, replacement)
                yield from self._statements(wanted, replacement)
            case _:
                yield from self._statements(wanted, replacement)

    def heads(self, wanted: ast.stmt, replacement: str) -> Iterator[Place]:
        said = _dumped_head(wanted)
        for node in self._nodes():
            if isinstance(node, _Block) and _dumped_head(node) == said:
                start, _ = self._ends(node, node)
                last = next(part for part in reversed(_head(node)) if hasattr(part, "end_lineno"))
                colon = self._text.index(b":", self._ends(last, last)[1])
                is_elif = self._text.startswith(b"elif", start)
                yield Place(start, colon + 1, "el" * is_elif + replacement)

    def _expressions(self, wanted: ast.expr, replacement: str) -> Iterator[Place]:
        said = ast.dump(wanted)
        for node in self._nodes():
            if isinstance(node, ast.expr) and ast.dump(node) == said:
                yield Place(*self._ends(node, node), f"({replacement})")

    def _keywords(self, name: str, wanted: ast.expr, replacement: str) -> Iterator[Place]:
        said = ast.dump(wanted)
        for node in self._nodes():
            if isinstance(node, ast.keyword) and node.arg == name and ast.dump(node.value) == said:
                yield Place(*self._ends(node, node), replacement or "**{}")

    def _statements(self, wanted: list[ast.stmt], replacement: str) -> Iterator[Place]:
        said = [ast.dump(statement) for statement in wanted]
        for block in self._blocks():
            dumps = [ast.dump(statement) for statement in block]
            for at in range(len(block) - len(said) + 1):
                if dumps[at : at + len(said)] == said:
                    ends = self._ends(block[at], block[at + len(said) - 1])
                    margin = "\n" + " " * block[at].col_offset
                    yield Place(*ends, margin.join((replacement or "pass").splitlines()))

    def _blocks(self) -> Iterator[list[ast.stmt]]:
        for node in self._definition.nodes:
            if isinstance(node, ast.Assign | ast.AnnAssign):
                yield [node]
        for node in self._nodes():
            for name in _BLOCKS:
                block = getattr(node, name, None)
                if isinstance(block, list) and block:
                    yield block

    def _nodes(self) -> Iterator[ast.AST]:
        for node in self._definition.nodes:
            yield from ast.walk(node)

    def _ends(self, first: ast.AST, last: ast.AST) -> tuple[int, int]:
        """Return where the first node begins, with its decorators, and where the last ends."""
        decorators = getattr(first, "decorator_list", [])
        start = self._offset(first.lineno, first.col_offset)
        if decorators:
            start = self._offset(decorators[0].lineno, decorators[0].col_offset) - len("@")
        return start, self._offset(last.end_lineno, last.end_col_offset)

    def _offset(self, line: int, column: int) -> int:
        return sum(map(len, self._text.splitlines(keepends=True)[: line - 1])) + column


def _head(node: ast.stmt) -> list[ast.AST]:
    """Return what stands before the colon of a block, in order."""
    parts = []
    for name, value in ast.iter_fields(node):
        if name not in _BLOCKS and isinstance(value, ast.AST | list):
            for each in value if isinstance(value, list) else [value]:
                parts += [each] if hasattr(each, "end_lineno") else ast.iter_child_nodes(each)
    return parts


def _dumped_head(node: ast.stmt) -> list[str]:
    return [type(node).__name__, *map(ast.dump, _head(node))]
