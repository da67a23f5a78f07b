"""Answers that are numbers of floating point: right when they are near enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Near:
    """Expected numbers; equal to a sequence of as many, each of them near its own."""

    values: tuple[float, ...]
    within: float
    """Of each value: so much of it, or of 1e-3 where it is less."""

    def __eq__(self, other: object) -> bool:
        """Tell whether an answer is right."""
        if not isinstance(other, Sequence) or len(other) != len(self.values):
            return False
        return all(
            abs(found - expected) <= self.within * max(abs(expected), 1e-3)
            for found, expected in zip(other, self.values, strict=True)
        )

    __hash__ = None  # type: ignore[assignment]  # near is not transitive
