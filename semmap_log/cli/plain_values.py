"""Reads values of a command line that need no library: texts, paths, numbers, what is not given.

From 0.29 on, typer has pydantic read the value of every option, also of those that are not given.
Loading pydantic takes as long as replaying a small log. Choices, lists and errors are still left to
it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any


def with_plain_readers(params: list[Any]) -> list[Any]:
    """Return typer's options and arguments, which now read plain values without pydantic.

    Those of a typer that has no pydantic are left as they are.
    """
    for param in params:
        reader = getattr(param, "get_runtime_param", None)
        if reader is not None and not isinstance(reader, partial):
            param.get_runtime_param = partial(_PlainReader, param.type_descriptor, reader)
    return params


_NUMBER: dict[Any, re.Pattern[str]] = {
    int: re.compile(r"-?\d{1,15}", re.ASCII),
    float: re.compile(r"-?\d{1,15}(\.\d+)?", re.ASCII),
}
"""How a number is written plainly; in other ways it is typer's to read."""


class _PlainReader:
    """Stands where typer has what reads a value."""

    def __init__(self, described: Any, others: Callable[[], Any]) -> None:
        self._about = described.parameter_info
        self._kind: Any = described.annotation if self._about.parser is None else None
        self._others = others

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return the value that was meant; what typer says of it where that is not plain."""
        is_one = not param.multiple and param.nargs != -1
        if value is None:
            return None if is_one else ()
        if is_one and type(value) is self._kind is not str:  # as the verb has it by default
            return value
        if is_one and type(value) is str and self._is_plain(value):
            return self._kind(value)
        return self._others().coerce(value, param=param, ctx=ctx)

    def _is_plain(self, text: str) -> bool:
        if self._kind is Path:  # not there, or can be read: else typer has something to say
            return not os.path.exists(text) or os.access(text, os.R_OK)  # noqa: PTH110
        if self._kind in _NUMBER and _NUMBER[self._kind].fullmatch(text):
            low, high = self._about.min, self._about.max
            return (low is None or float(text) >= low) and (high is None or float(text) <= high)
        return self._kind is str
