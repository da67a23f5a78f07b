"""Where functions run: in this process, one after the other, or on what others have built.

An engine is one function: it takes questions and yields answers, in any order, each once. For all
engines: a worker that dies loses nothing but the question that killed it, and no question is waited
for without end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

DEATHS = 3
"""A question that has killed more workers than this is given up."""
TIMEOUT_S = 3600.0
"""If no question is answered for so long, the remaining ones are given up."""


class WorkerDied:
    """Replaces an answer: each worker that was given the question was ended."""


@dataclass(frozen=True, slots=True)
class NoAnswer:
    """Replaces an answer: no worker answered for so long, and no more are waited for."""

    within_s: float


class Engine(Protocol):
    """What runs functions."""

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, questions: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield (number of a question, `function(shared, question)`, `WorkerDied` or `NoAnswer`).

        Args:
            function: Of a module that workers have, too.
            shared: Its first argument.
            questions: The second ones.

        Raises:
            EngineError: The engine itself has gone.
        """

    def close(self) -> None:
        """End what was started."""


class SerialEngine:
    """This process: it has no workers to lose, so each question is waited for."""

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, questions: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield answers in order."""
        for number, question in enumerate(questions):
            yield number, function(shared, question)

    def close(self) -> None:
        """End nothing."""
