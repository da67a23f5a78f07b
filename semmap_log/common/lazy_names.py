"""Public names of a package that are loaded when they are first used, not when it is imported."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any


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
