"""What is made on first use: attributes of objects, names of packages, patterns."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

T = TypeVar("T")


class computed_once(cached_property[T]):  # noqa: N801  # a decorator, named as the library's
    """`functools.cached_property` without its lock, as it is from Python 3.12 on.

    Before that, one lock serves all objects of a class. Reading one segment would wait for the
    reading of another, and a process that forks while a thread computes would leave its child that
    lock, held for ever. Two threads may compute a value at the same time: the results are equal.
    """

    def __init__(self, compute: Callable[[Any], T]) -> None:
        """Take what computes the value."""
        super().__init__(compute)
        self.lock = nullcontext()


def lazy_names(package: str, homes: Mapping[str, Sequence[str]]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package.

    Args:
        package: Its name, `__name__`.
        homes: Module -> its names that the package has, too. Modules are named from the root of
            `semmap_log`.
    """
    root = package.partition(".")[0]
    home_of = {name: home for home, names in homes.items() for name in names}

    def load(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(f"{root}.{home_of[name]}"), name)
        setattr(sys.modules[package], name, value)
        return value

    return load


if TYPE_CHECKING:
    late_pattern = re.compile
else:

    class late_pattern:  # noqa: N801  # stands for a function
        """`re.compile`, done when the pattern is first used: most programs use few of them."""

        def __init__(self, pattern: str, flags: int = 0) -> None:
            """Take what `re.compile` takes."""
            self._told = (pattern, flags)

        def __getattr__(self, name: str) -> Any:
            found = getattr(re.compile(*self._told), name)
            setattr(self, name, found)
            return found
