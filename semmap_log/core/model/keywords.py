"""Keywords of the Python API: stated once where many calls take them, and refused where unknown.

Keywords that many calls share are a `TypedDict`, which each takes as `**keywords: Unpack[Shared]`.
The help and `inspect.signature` of such a call list each of them by its name.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from types import CodeType, FunctionType
from typing import Any, ParamSpec, TypeVar

from semmap_log.errors import UnknownKeywordError

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)

_SHARED: dict[str, Mapping[str, Any]] = {}
"""Name of a `TypedDict` of keywords -> what each of them is where it is not given."""


def share_keywords(keywords: type, defaults: Mapping[str, Any]) -> None:
    """Make a `TypedDict` the keywords that calls take as `**name: Unpack[keywords]`.

    Args:
        keywords: The class; all of its keys may be left out.
        defaults: The default of each, in the order in which they are listed.
    """
    assert list(defaults) == list(keywords.__annotations__), "each keyword has a default"
    _SHARED[keywords.__name__] = defaults


def knows_keywords(call: Callable[P, R]) -> Callable[P, R]:
    """Return the function, wrapped so that it refuses unknown keywords with a helpful error.

    Python refuses them, too, but shows neither the known ones nor what was meant. A function
    without keywords is left to Python.
    """
    code: CodeType = call.__code__
    known = _keywords_of(code)
    if code.co_flags & inspect.CO_VARKEYWORDS:
        shared = _shared_of(call)
        if shared is None:
            return call
        call.__signature__ = _spelt_out(call, shared)  # type: ignore[attr-defined]
        known |= dict.fromkeys(_SHARED[shared.__name__])
    if not known:
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
    getattr(cls, "__init__", None)  # of a dataclass: made on first access
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
        known: Those that it knows, in the order in which they are listed.
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


def _shared_of(call: Callable[..., Any]) -> type | None:
    """Return the class of the keywords that a call takes besides its own; None: any whatever."""
    parameters = inspect.signature(call).parameters.values()
    (more,) = (each for each in parameters if each.kind is each.VAR_KEYWORD)
    name = str(more.annotation).removeprefix("Unpack[").removesuffix("]")
    return call.__globals__[name] if name in _SHARED else None


def _spelt_out(call: Callable[..., Any], shared: type) -> inspect.Signature:
    """Return the signature of a call with each of the keywords that it takes besides its own."""
    written = inspect.signature(call)
    own = [each for each in written.parameters.values() if each.kind is not each.VAR_KEYWORD]
    more = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=default,
            annotation=_as_written(shared.__annotations__[name]),
        )
        for name, default in _SHARED[shared.__name__].items()
    ]
    return written.replace(parameters=[*own, *more])


def _as_written(annotation: Any) -> Any:
    """Return an annotation as it stands in the code, where a `TypedDict` has made more of it."""
    return getattr(annotation, "__forward_arg__", annotation)
