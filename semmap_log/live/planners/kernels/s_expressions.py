r"""S-expressions as OPRS kernels send and take them.

    (ASK 17 (DOOR_OPEN DOOR_3))      a tuple of an Atom, an int and a tuple
    (ANSWER 17 (. DOOR_1 DOOR_2 .))  the inner one is a list
    (DOOR_NAME DOOR_3 "main \"A\"")  a text in quotes is a str
    (DOOR_PROBABILITY DOOR_3 0.75)   a number with a dot is a float

What is written is read back as the same, floats to their last digit, and is safe for a kernel: on
one line, without control characters, and with no text that ends in a backslash. A kernel runs what
follows a line's end as commands. For it, `\"` may or may not end a text, so that what follows a
last backslash would be outside of all quotes.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import NoReturn, TypeAlias

from semmap_log.errors import ExpressionError
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.live.planners.question_lines import Atom

Expression: TypeAlias = (
    "Atom | str | int | float | tuple[Expression, ...] | list[Expression] | Variable"
)

MOST_DEPTH = 64
"""Of expressions in expressions."""
MOST_TEXT = 4096
"""Characters of a text: a kernel's time grows with the square of its length."""


class Variable(str):
    """A variable that a kernel has not bound, such as `$X`."""

    __slots__ = ()


def read_expression(text: str) -> tuple[Expression, ...]:
    """Return the one expression in parentheses that a text is.

    Raises:
        ExpressionError: It is none.
    """
    return _Reader(text).read()


def write_expression(expression: tuple[Expression, ...]) -> str:
    """Return an expression as a text on one line.

    Raises:
        ExpressionError: A kernel could not read it, or would read something else.
    """
    if not isinstance(expression, tuple):
        raise ExpressionError(f"expected an expression in parentheses, got {expression!r}.")
    return _written(expression, 0)


def sendable(text: str) -> str:
    r"""Return a text that is other people's words as one that can be written.

    What a kernel could not take is written visibly, NUL as `\u0000`; a text that is too long ends
    in `…`, and one that ends in a backslash gets a blank after it.
    """
    if len(text) > MOST_TEXT:
        text = text[:MOST_TEXT]
    text = "".join(each if _is_plain(each) else json.dumps(each)[1:-1] for each in text)
    if len(text) > MOST_TEXT:
        text = f"{text[: MOST_TEXT - 1]}…"
    return f"{text[: MOST_TEXT - 1]} " if text.endswith("\\") else text


def is_atom(text: str) -> bool:
    """Return whether a text can be written as an atom."""
    if text.startswith("|"):
        return _BARRED.fullmatch(text) is not None and text.isprintable()
    return (
        _ATOM.fullmatch(text) is not None
        and all(each.isascii() or (each.isprintable() and not each.isspace()) for each in text)
        and text.lower() not in _KEYWORDS
    )


_ATOM = re.compile(r"[A-Za-z_\u0080-\U0010ffff][A-Za-z0-9_.+*/<=>!?%'\-\u0080-\U0010ffff]*")
_BARRED = re.compile(r"\|[^|\\]+\|")
_KEYWORDS = frozenset(
    ("if", "else", "elseif", "while", "do", "break", "goto", "label", "defop", "defka")
)
"""Of a kernel's plans, in any case of letters: elsewhere they are syntax errors."""


def _is_plain(character: str) -> bool:
    return character.isprintable() or character in "\n\t"


def _written(value: Expression, depth: int) -> str:
    if isinstance(value, (tuple, list)):
        if depth >= MOST_DEPTH:
            raise ExpressionError(f"expected at most {MOST_DEPTH} expressions in one another.")
        inner = " ".join(_written(each, depth + 1) for each in value)
        if isinstance(value, list):
            return f"(. {inner} .)" if inner else "(. .)"
        if not value or not isinstance(value[0], Atom):
            raise ExpressionError(f"expected an expression with an atom first, got {value!r}.")
        return f"({inner})"
    if isinstance(value, Variable):
        raise ExpressionError(f"expected a value, got the variable {value}.")
    if isinstance(value, Atom):
        if not is_atom(value):
            raise ExpressionError(f"{shown(str(value))} cannot be written as an atom.")
        return str(value)
    if isinstance(value, str):
        return _quoted(value)
    return _number(value)


def _quoted(text: str) -> str:
    if len(text) > MOST_TEXT or text.endswith("\\") or not all(map(_is_plain, text)):
        raise ExpressionError(
            f"{shown(text)} cannot be sent: expected at most {MOST_TEXT:,} characters, none of "
            "them a control character, and no backslash at the end."
        )
    return f'"{_ESCAPED.sub(lambda found: _ESCAPES[found[0]], text)}"'


_ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t"}
_ESCAPED = re.compile(r'[\\"\n\t]')
_UNESCAPES = {"n": "\n", "t": "\t"}


def _number(value: object) -> str:
    if isinstance(value, float) and math.isfinite(value):
        text = repr(value)
        return text if "." in text else text.replace("e", ".0e")
    if isinstance(value, int) and not isinstance(value, bool):
        if -(2**31) <= value < 2**31:
            return str(value)
        if -(2**63) <= value < 2**63:
            return f"{value}ll"
    raise ExpressionError(f"{value!r} cannot be written: expected a number of 64 bits, or a text.")


_TOKEN = re.compile(
    r"""[ \t\r\n]*(?:
      (?P<list>\(\.) | (?P<open>\() | (?P<end_list>\.\)) | (?P<close>\))
    | (?P<text>"[^"\\]*(?:\\.[^"\\]*)*")
    | (?P<float>[-+]?[0-9]+\.[0-9]*(?:[eE][-+]?[0-9]+)?(?=[\s()"]|$))
    | (?P<int>[-+]?[0-9]+(?=(?:ll?)?(?:[\s()"]|$)))l?l?
    | (?P<variable>(?:\$|@@?)[^\s~0-9:"&()$@;|.\[\]][^\s:"()\[\]]*)
    | (?P<atom>\|[^|]+\| | [~&] | [^\s~0-9:"&()$@;|.\[\]][^\s:"()\]]*)
    | (?P<end>$)
    )""",
    re.VERBOSE | re.DOTALL,
)


class _Reader:
    """Reads one expression, token by token; none is deeper than the machine's stack allows."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._open: list[list[Expression]] = []
        self._is_list: list[bool] = []

    def read(self) -> tuple[Expression, ...]:
        """Return it."""
        at = 0
        while True:
            token = _TOKEN.match(self._text, at)
            if token is None:
                self._refuse(at, "expected an atom, a number, a text or a parenthesis")
            kind = token.lastgroup
            if kind in ("open", "list"):
                self._begin(token.start(kind), is_list=kind == "list")
            elif kind in ("close", "end_list"):
                found = self._finish(token.start(kind), is_list=kind == "end_list")
                if not self._open:
                    return self._alone(found, token.end())
            else:
                self._take(kind, token)
            at = token.end()

    def _begin(self, at: int, *, is_list: bool) -> None:
        if is_list and not self._open:
            self._refuse(at, "expected an expression, not a list")
        if len(self._open) >= MOST_DEPTH:
            self._refuse(at, f"expected at most {MOST_DEPTH} expressions in one another")
        self._open.append([])
        self._is_list.append(is_list)

    def _finish(self, at: int, *, is_list: bool) -> Expression:
        if not self._open or self._is_list.pop() != is_list:
            self._refuse(at, "expected the parenthesis that fits the one before")
        inner = self._open.pop()
        if not is_list and not (inner and isinstance(inner[0], Atom)):
            self._refuse(at, "expected an expression with an atom first")
        found: Expression = inner if is_list else tuple(inner)
        if self._open:
            self._open[-1].append(found)
        return found

    def _alone(self, found: Expression, at: int) -> tuple[Expression, ...]:
        if self._text[at:].strip(" \t\r\n"):
            self._refuse(at, "expected one expression")
        assert isinstance(found, tuple)
        return found

    def _take(self, kind: str | None, token: re.Match[str]) -> None:
        assert kind is not None
        if not self._open:
            self._refuse(token.start(kind), "expected an expression in parentheses")
        if kind == "end":
            self._refuse(token.start(kind), "expected a closing parenthesis")
        self._open[-1].append(self._value(kind, token))

    def _value(self, kind: str, token: re.Match[str]) -> Expression:
        text = token[kind]
        if kind == "text":
            return _UNESCAPED.sub(lambda each: _UNESCAPES.get(each[1], each[1]), text[1:-1])
        if kind == "float":
            return float(text)
        if kind == "int":
            if len(text) > _MOST_DIGITS or not -(2**63) <= int(text) < 2**63:
                self._refuse(token.start(kind), "expected a whole number of 64 bits")
            return int(text)
        return Variable(text) if kind == "variable" else Atom(text)

    def _refuse(self, at: int, expected: str) -> NoReturn:
        got = shown(self._text[at : at + 40]) if at < len(self._text) else "the end"
        raise ExpressionError(f"at {at + 1}: {expected}, got {got}.")


_UNESCAPED = re.compile(r"\\(.)", re.DOTALL)
_MOST_DIGITS = 40


def flat(values: Sequence[Expression]) -> list[Atom | str | int | float | Variable]:
    """Return all that stands in values, and in what they hold, in its order."""
    found: list[Atom | str | int | float | Variable] = []
    for each in values:
        found += flat(each) if isinstance(each, (tuple, list)) else [each]
    return found
