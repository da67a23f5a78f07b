"""What runs beside the verbs that write for long, and tells at the end how far it has come."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import typer


@contextmanager
def told_at_end(beside: AbstractContextManager[object], say: Callable[[], None]) -> Iterator[None]:
    """Run something beside, and say at the end how it stands, whatever the verb's exit code."""
    left: typer.Exit | None = None
    with beside:
        try:
            yield
        except typer.Exit as asked:  # no failure: the log is closed, and says its exit code
            left = asked
    say()
    if left is not None:
        raise left
