"""Refuses keywords that a call of the Python API does not know, and says what was meant.

Keywords that many calls share are a `TypedDict`, which each takes as `**keywords: Unpack[Shared]`;
whoever reads them checks them. Other calls leave that to Python.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from semmap_log.errors import UnknownKeywordError


def check_keywords(call: Callable[..., Any], given: Mapping[str, object], shared: type) -> None:
    """Check that all keywords beyond a call's own are shared ones.

    Args:
        call: The function or method.
        given: What it got beyond its own parameters.
        shared: The `TypedDict` of the shared ones.

    Raises:
        UnknownKeywordError: One is not.
    """
    known = shared.__annotations__
    for got in given:
        if got not in known:
            parameters = inspect.signature(call).parameters.values()
            own = [each.name for each in parameters if each.kind is not each.VAR_KEYWORD]
            raise unknown_keyword(f"{call.__qualname__}()", got, [*own, *known])


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
