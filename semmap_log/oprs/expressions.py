r"""OpenPRS's expressions as text: `(DOOR_STATE DOOR_3 OPEN)`, `(. 0.5 "seen by \"a laser\"" .)`.

What is written here is one line with one expression, whatever words of other people are in it:
outside of a text, a kernel runs what follows a line's end as commands of its own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from semmap_log.errors import SemmapError

DEEPEST = 64
"""Lists and records in each other."""
INTEGER_LIMIT = 2**31
"""From here on a kernel's plain integers wrap; there are longer ones, with `ll` behind them."""
LONG_LIMIT = 2**63


class ExpressionError(SemmapError):
    """A text is no expression, or a value cannot be written as one."""


class Symbol(str):
    """An atom, such as `DOOR_3`; `main door` is written `|main door|`."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Expression:
    """A composed term, a name and its terms: a predicate, a fact, a question."""

    name: Symbol
    terms: tuple[Term, ...] = ()


Term: TypeAlias = "Symbol | str | int | float | list[Term] | Expression"
"""A `str` that is no `Symbol` is a text; a list is `(. a b .)`."""

NIL, TRUE = Symbol("NIL"), Symbol("T")


def write(term: Term) -> str:
    """Return a term as text.

    In texts, control characters that a kernel cannot be told become blanks, and a blank is added
    behind a backslash at the end: a kernel would take that and the quote for a quote in the text,
    and what stands behind the text for a part of it. Numbers that are none are NIL.

    Raises:
        ExpressionError: A name that no kernel could read, an integer of more than 64 bits, lists
            that are nested too deep.
    """
    return _write(term, 0)


def _write(term: Term, depth: int) -> str:
    if depth > DEEPEST:
        raise ExpressionError(f"expected at most {DEEPEST} lists in each other, got more.")
    if isinstance(term, Expression):
        return (
            f"({' '.join([_atom(term.name), *(_write(each, depth + 1) for each in term.terms)])})"
        )
    if isinstance(term, list):
        return " ".join(["(.", *(_write(each, depth + 1) for each in term), ".)"])
    if isinstance(term, Symbol):
        return _atom(term)
    if isinstance(term, str):
        return _text(term)
    return _float(term) if isinstance(term, float) else _integer(term)


_NAME = re.compile(r"[A-Za-z_\u0080-\U0010ffff][\w.\-\u0080-\U0010ffff]*")
_BARRED = re.compile(r"[^|\x00-\x1f\x7f]+")


def _atom(name: Symbol) -> str:
    if _NAME.fullmatch(name) and name.isprintable():
        return str(name)
    if not _BARRED.fullmatch(name):
        raise ExpressionError(f"expected a name without bars and control characters, got {name!r}.")
    return f"|{name}|"


_ESCAPED = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t"}
_TO_ESCAPE = re.compile(r'["\\\x00-\x1f\x7f]')


def _text(text: str) -> str:
    escaped = _TO_ESCAPE.sub(lambda found: _ESCAPED.get(found[0], " "), text)
    return f'"{escaped} "' if escaped.endswith("\\\\") else f'"{escaped}"'


def _integer(number: int) -> str:
    if -INTEGER_LIMIT <= number < INTEGER_LIMIT:
        return str(int(number))
    if -LONG_LIMIT <= number < LONG_LIMIT:
        return f"{number}ll"
    raise ExpressionError(f"expected an integer of 64 bits, got {number}.")


def _float(number: float) -> str:
    """Return the shortest text that is the same number; a kernel wants a point before the e."""
    if not math.isfinite(number):
        return NIL
    mantissa, e, exponent = repr(number).partition("e")
    return f"{mantissa if '.' in mantissa else f'{mantissa}.0'}{e}{exponent}"


def read(text: str) -> Term:
    """Return the term that a text is.

    Raises:
        ExpressionError: It is none, or more than one; where, what was expected.
    """
    reader = _Reader(text)
    term = reader.term(0)
    reader.expect_end()
    return term


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    at: int


_TOKEN = re.compile(
    r"""[ \t\r\n]*(?:
        (?P<text>"(?:[^"\\]|\\.)*")
      | (?P<opens>\(\.?)
      | (?P<closes>\.\)|\))
      | (?P<barred>\|[^|]+\|)
      | (?P<word>[^\s()"|]+)
      | (?P<end>$)
    )""",
    re.VERBOSE | re.DOTALL,
)
_INTEGER = re.compile(r"[-+]?[0-9]+(?:ll?)?")
_REAL = re.compile(r"[-+]?[0-9]+\.[0-9]*(?:[eE][-+]?[0-9]+)?")
_UNESCAPED = {"n": "\n", "t": "\t"}


class _Reader:
    def __init__(self, text: str) -> None:
        self._tokens = _tokens(text)

    def term(self, depth: int) -> Term:
        """Return the next term."""
        return self._term_from(next(self._tokens), depth)

    def expect_end(self) -> None:
        """Refuse what is behind the term."""
        if (token := next(self._tokens)).kind != "end":
            raise _unexpected(token, "nothing behind the expression")

    def _term_from(self, token: _Token, depth: int) -> Term:
        if depth > DEEPEST:
            raise _unexpected(token, f"at most {DEEPEST} lists in each other")
        if token.kind == "text":
            return re.sub(
                r"\\(.)", lambda found: _UNESCAPED.get(found[1], found[1]), token.text[1:-1],
                flags=re.DOTALL,
            )  # fmt: skip
        if token.kind == "barred":
            return Symbol(token.text[1:-1])
        if token.kind == "word":
            return _number(token.text)
        if token.text == "(.":
            return list(self._terms(".)", depth))
        if token.text == "(":
            name = self._term_from(next(self._tokens), depth + 1)
            if not isinstance(name, Symbol):
                raise _unexpected(token, "a name behind it")
            return Expression(name, tuple(self._terms(")", depth)))
        raise _unexpected(token, "a term")

    def _terms(self, closing: str, depth: int) -> Iterator[Term]:
        while (token := next(self._tokens)).text != closing or token.kind != "closes":
            yield self._term_from(token, depth + 1)


def _tokens(text: str) -> Iterator[_Token]:
    at = 0
    while True:
        found = _TOKEN.match(text, at)
        if found is None or found.lastgroup is None:
            raise _unexpected(_Token("", text[at : at + 20], at), "a term")
        yield _Token(found.lastgroup, found[found.lastgroup], found.start(found.lastgroup))
        at = found.end()


def _number(word: str) -> Term:
    if _INTEGER.fullmatch(word):
        return int(word.rstrip("l"))
    return float(word) if _REAL.fullmatch(word) else Symbol(word)


def _unexpected(token: _Token, expected: str) -> ExpressionError:
    got = repr(token.text) if token.text else "the end"
    return ExpressionError(f"character {token.at + 1}: expected {expected}, got {got}.")
