"""What goes on while a query has rows made: what went wrong, and whether anybody still waits.

DuckDB calls us on threads of its own, and passes on of our errors no more than the text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.scanned_table import Read, ScanRequest

A = TypeVar("A")


class StoppedError(Exception):
    """Nobody waits for the rows any more."""


class RowMaking:
    """Takes note of what goes wrong in functions that make rows."""

    def __init__(self) -> None:
        self.failure: Exception | None = None
        """The last."""
        self._is_stopped = False

    def taken_failure(self) -> Exception | None:
        """Return what went wrong last, once: raised, it holds frames again."""
        failure, self.failure = self.failure, None
        return failure

    def stop(self) -> None:
        """Have those that make tables end before their next one."""
        self._is_stopped = True

    def noted(self, make: Callable[[A], pa.Table]) -> Callable[[A], pa.Table]:
        """Return a function that makes rows, and whose failures are noted."""

        def made(asked: A) -> pa.Table:
            try:
                self._check_wanted()
                return make(asked)
            except Exception as error:  # noqa: BLE001 - told by `failure`
                raise self._noted(error) from None

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
            except Exception as error:  # noqa: BLE001 - told by `failure`
                raise self._noted(error) from None

        return found

    def _noted(self, error: Exception) -> Exception:
        """Keep what went wrong, and return what DuckDB is told of it.

        It is kept without its frames, which would hold DuckDB, and DuckDB us, for ever.
        """
        self.failure = error.with_traceback(None)
        error.__cause__ = error.__context__ = None
        return RuntimeError(f"{type(error).__name__}: {error}")

    def _check_wanted(self) -> None:
        """Return if somebody waits for rows.

        Raises:
            StoppedError: Nobody does.
        """
        if self._is_stopped:
            raise StoppedError
