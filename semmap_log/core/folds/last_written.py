"""Registers over time: what each of many keys held at a stamp, asked of many at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.distinct import distinct

Integers = NDArray[np.integer[Any]]

MAX_TABLE = 2**20
"""Keys below are looked up in a table; greater ones are searched for."""


class LastWritten:
    """Values by key and stamp, (happened, number); the one with the greatest stamp counts."""

    def __init__(
        self,
        keys: Integers,
        happened_ns: NDArray[np.int64],
        numbers: NDArray[np.int64],
        values: NDArray[np.int64],
        *,
        nothing: int,
    ) -> None:
        """Take all that was ever written, in any order.

        Args:
            keys: What each was written to.
            happened_ns: When it happened.
            numbers: Of its event.
            values: What was written.
            nothing: What a key holds before anything was.
        """
        order = np.lexsort((numbers, happened_ns, keys))
        keys, values = keys[order], values[order]
        is_first = np.diff(keys, prepend=-1) != 0
        before = np.where(is_first, nothing, np.roll(values, 1))
        changes = np.flatnonzero(values != before)
        self._happened_ns = happened_ns[order][changes]
        self._numbers = numbers[order][changes]
        self._values = np.append(values[changes], nothing)
        """The last is that of whoever has none before it, by the place -1."""
        self._keys, self._starts = np.unique(keys[changes], return_index=True)
        self._ends = np.append(self._starts[1:], len(changes))
        self._starts, self._ends = np.append(self._starts, 0), np.append(self._ends, 0)
        """Of each key, and last of a key that is none of them."""
        self._last_ns = np.append(self._happened_ns, -1)[self._ends - 1]
        self._final = np.where(self._ends > self._starts, self._values[self._ends - 1], nothing)
        self._latest_ns = self._last_ns.max()
        self._table = self._table_of_keys()

    def __contains__(self, key: int) -> bool:
        """Tell whether a key ever held something."""
        return key in self._keys

    def values(self) -> list[int]:
        """Return what was ever held, each value once."""
        found: list[int] = distinct(self._values[:-1]).tolist()
        return found

    def at(
        self, keys: Integers, happened_ns: NDArray[np.int64], numbers: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return what keys held right after events of these stamps."""
        rows = self._rows(keys)
        found: NDArray[np.int64] = self._final.take(rows)
        if not len(keys) or happened_ns.min() > self._latest_ns:  # as nearly always
            return found
        early = np.flatnonzero(happened_ns <= self._last_ns.take(rows))
        if len(early):
            found[early] = self._values[
                self._behind(rows[early], happened_ns[early], numbers[early]) - 1
            ]
        return found

    def _behind(
        self, rows: NDArray[np.intp], happened_ns: NDArray[np.int64], numbers: NDArray[np.int64]
    ) -> NDArray[np.intp]:
        """Return the place behind the last change up to each stamp; 0: its key has none so early.

        All are halved at once, as often as the key with the most changes needs.
        """
        low, high = self._starts[rows], self._ends[rows]
        first = low.copy()
        while (is_open := low < high).any():
            middle = np.where(is_open, (low + high) // 2, 0)
            ns = self._happened_ns[middle]
            is_by_then = (ns < happened_ns) | (
                (ns == happened_ns) & (self._numbers[middle] <= numbers)
            )
            low = np.where(is_open & is_by_then, middle + 1, low)
            high = np.where(is_open & ~is_by_then, middle, high)
        return np.where(low > first, low, 0)

    def _rows(self, keys: Integers) -> NDArray[np.intp]:
        """Return the place of each key among those that have changes; behind them: it has none."""
        if self._table is not None:
            return self._table.take(keys, mode="clip")
        rows = np.searchsorted(self._keys, keys)
        is_known = np.append(self._keys, -1)[rows] == keys
        return np.where(is_known, rows, len(self._keys))

    def _table_of_keys(self) -> NDArray[np.intp] | None:
        if len(self._keys) and self._keys[-1] >= MAX_TABLE:
            return None
        size = int(self._keys[-1]) + 2 if len(self._keys) else 1
        table = np.full(size, len(self._keys), np.intp)  # greater keys are clipped to the last
        table[self._keys] = np.arange(len(self._keys))
        return table
