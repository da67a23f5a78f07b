"""Questions of a class that rooms built on it answer: who knows all rooms says which.

`log.sql(…)` is a question to a log, and what answers it stands on the log. So the class asks by a
name, and the front door, which knows all rooms, has told where the answer is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

_homes: dict[str, str] = {}


def register_answers(homes: Mapping[str, str]) -> None:
    """Say what answers questions.

    Args:
        homes: Question -> `module:function`, which is loaded when somebody asks.
    """
    _homes.update(homes)


def answer_of(question: str) -> Callable[..., Any]:
    """Return what answers a question (KeyError: nobody said)."""
    module, name = _homes[question].split(":")
    answer: Callable[..., Any] = getattr(import_module(module), name)
    return answer
