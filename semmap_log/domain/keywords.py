"""A keyword that a call of the Python API does not know is an error; it names the known ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from types import CodeType, FunctionType
from typing import ParamSpec, TypeVar

from semmap_log.errors import UnknownKeywordError

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)

VAR_KEYWORDS = 0x08
"""Of a function's code: it takes any keyword (`inspect.CO_VARKEYWORDS`)."""


def knows_keywords(call: Callable[P, R]) -> Callable[P, R]:
    """Return a function that refuses keywords which the given one does not know, and does the same.

    Python refuses them, too, but tells neither the known ones nor what was meant. What takes none
    at all is left to Python.
    """
    code: CodeType = call.__code__
    known = _keywords_of(code)
    if code.co_flags & VAR_KEYWORDS or not known:
        return call
    name = f"{call.__qualname__.removesuffix('.__init__')}()"

    @wraps(call)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        if kwargs and not kwargs.keys() <= known.keys():
            raise unknown_keyword(name, next(key for key in kwargs if key not in known), known)
        return call(*args, **kwargs)

    return checked


def knows_its_keywords(cls: C) -> C:
    """Have a class, and its public methods, refuse keywords that they do not know."""
    for name, member in list(vars(cls).items()):
        if name.startswith("_") and name != "__init__":
            continue
        if isinstance(member, (classmethod, staticmethod)):
            setattr(cls, name, type(member)(knows_keywords(member.__func__)))
        elif isinstance(member, FunctionType):
            setattr(cls, name, knows_keywords(member))
    return cls


def unknown_keyword(call: str, got: str, known: Iterable[str]) -> UnknownKeywordError:
    """Return the error of a call that was given a keyword which it does not know.

    Args:
        call: Its name.
        got: The keyword.
        known: Those that it knows, in the order in which they are told.
    """
    from difflib import get_close_matches

    known = list(known)
    close = get_close_matches(got, known, n=1)
    meant = f" (did you mean {close[0]!r}?)" if close else ""
    expected = f"expected some of {', '.join(known)}"
    return UnknownKeywordError(f"{call}: keyword {got!r}{meant}: {expected}.")


def _keywords_of(code: CodeType) -> dict[str, None]:
    """Return the names that can be given as keywords, in order."""
    end = code.co_argcount + code.co_kwonlyargcount
    names = code.co_varnames[code.co_posonlyargcount : end]
    return {name: None for name in names if name not in ("self", "cls")}
