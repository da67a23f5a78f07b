"""What goes on while a query has rows made: what went wrong, and whether anybody still waits.

DuckDB calls us on threads of its own, and passes on of our errors no more than the text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

from semmap_log.arrow.arrow_sdk import pa
from semmap_log.arrow.scanned_table import Read, ScanRequest

A = TypeVar("A")


class StoppedError(Exception):
    """Nobody waits for the rows any more."""


class RowMaking:
    """Takes note of what goes wrong in functions that make rows."""

    def __init__(self) -> None:
        self.failure: BaseException | None = None
        """The last."""
        self._is_stopped = False

    def stop(self) -> None:
        """Have those that yield tables end before their next one."""
        self._is_stopped = True

    def noted(self, make: Callable[[A], pa.Table]) -> Callable[[A], pa.Table]:
        """Return a function that makes rows, and whose failures are noted."""

        def made(asked: A) -> pa.Table:
            try:
                return make(asked)
            except BaseException as error:
                self.failure = error
                raise

        return made

    def tables(self, read: Read) -> Read:
        """Return what yields tables, and whose failures are noted."""

        def found(asked: ScanRequest) -> Iterator[pa.Table]:
            try:
                for table in read(asked):
                    self._check_wanted()
                    yield table
            except GeneratorExit:
                raise  # the query has all that it wants
            except BaseException as error:
                self.failure = error
                raise

        return found

    def _check_wanted(self) -> None:
        """Return if somebody waits for rows.

        Raises:
            StoppedError: Nobody does.
        """
        if self._is_stopped:
            raise StoppedError
