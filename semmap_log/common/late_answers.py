"""Questions of a class that rooms built on it answer: who knows all rooms says which.

`log.sql(…)` is a question to a log, and what answers it stands on the log. So the class asks by a
name, and the front door, which knows all rooms, has told where the answer is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Answer = Callable[..., Any]

_loaders: dict[str, Callable[[], Answer]] = {}


def register_answer(question: str, load: Callable[[], Answer]) -> None:
    """Say what answers a question.

    Args:
        question: Its name.
        load: Returns what answers; called when somebody asks.
    """
    _loaders[question] = load


def answer_of(question: str) -> Answer:
    """Return what answers a question (KeyError: nobody said)."""
    return _loaders[question]()
