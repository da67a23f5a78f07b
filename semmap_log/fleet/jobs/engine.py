"""Where functions run: here, one after the other, or on what others have built.

An engine is one function: it takes questions and yields answers, in any order, each once. What
holds for all of them: a worker that dies takes nothing along but the question that killed it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

DEATHS = 3
"""A question that has killed more workers than that is given up."""


class WorkerDied:
    """In the place of an answer: each worker that was given the question was ended."""


class Engine(Protocol):
    """What runs functions."""

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, questions: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield (number of a question, `function(shared, question)` or `WorkerDied`).

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
    """This process."""

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, questions: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield answers in order."""
        for number, question in enumerate(questions):
            yield number, function(shared, question)

    def close(self) -> None:
        """End nothing."""
