"""Queries of a class that packages built on it answer: the top package registers the answers.

`log.sql(…)` is a query to a log, and what answers it is built on the log. So the class looks it up
by name, and the top package, which knows all others, has registered where the answer is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

_homes: dict[str, str] = {}


def register_answers(homes: Mapping[str, str]) -> None:
    """Register what answers queries.

    Args:
        homes: Query -> `module:function`, which is loaded on first use.
    """
    _homes.update(homes)


def answer_of(question: str) -> Callable[..., Any]:
    """Return what answers a query (KeyError: nothing is registered)."""
    module, name = _homes[question].split(":")
    answer: Callable[..., Any] = getattr(import_module(module), name)
    return answer
