"""Attributes that are computed when they are first asked for, and then kept."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import cached_property
from typing import Any, TypeVar

T = TypeVar("T")


class computed_once(cached_property[T]):  # noqa: N801  # a decorator, named as the library's
    """`functools.cached_property` without its lock, as it is from Python 3.12 on.

    Before, one lock serves all objects of a class. Who reads one segment would wait for who reads
    another, and a process that forks while a thread computes would leave its child that lock, held
    for ever. Two threads that ask at once may both compute: the values are equal.
    """

    def __init__(self, compute: Callable[[Any], T]) -> None:
        """Take what computes the value."""
        super().__init__(compute)
        self.lock = nullcontext()
