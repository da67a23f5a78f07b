"""Which numbers the events of a file get in the log that imports them."""

from __future__ import annotations

from array import array
from bisect import bisect_right


class NumberMap:
    """Runs of event numbers, of the file and of the log; both ascend, gaps allowed."""

    def __init__(self) -> None:
        self._firsts, self._targets, self._counts = array("q"), array("q"), array("q")

    def add(self, source: int, target: int) -> None:
        """Note what the next event of the file is called in the log.

        A number that is not greater than the last begins anew: another log's events follow.
        """
        if self._counts:
            last = self._firsts[-1] + self._counts[-1] - 1
            if source <= last:
                del self._firsts[:], self._targets[:], self._counts[:]
            elif source == last + 1 and target == self._targets[-1] + self._counts[-1]:
                self._counts[-1] += 1
                return
        self._firsts.append(source)
        self._targets.append(target)
        self._counts.append(1)

    def ranges(self, first: int, last: int) -> list[tuple[int, int]]:
        """Return the log's numbers of the file's events `first` to `last`, as few ranges."""
        found: list[tuple[int, int]] = []
        for i in range(max(bisect_right(self._firsts, first) - 1, 0), len(self._firsts)):
            start, target = self._firsts[i], self._targets[i]
            if start > last:
                break
            low, high = max(first, start), min(last, start + self._counts[i] - 1)
            if low > high:
                continue
            piece = target + low - start, target + high - start
            if found and found[-1][1] + 1 == piece[0]:
                found[-1] = found[-1][0], piece[1]
            else:
                found.append(piece)
        return found


class OpenRetractions:
    """Retracted events of a file whose retraction has not come yet."""

    def __init__(self) -> None:
        self._runs: list[tuple[int, int, int]] = []
        """First and last number, and the line of the first."""

    def add(self, number: int, line: int) -> None:
        """Note a retracted event."""
        if self._runs and self._runs[-1][1] + 1 == number:
            first, _, its_line = self._runs[-1]
            self._runs[-1] = first, number, its_line
        else:
            self._runs.append((number, number, line))

    def cover(self, first: int, last: int) -> None:
        """Take note of a retraction of these."""
        left = []
        for low, high, line in self._runs:
            if low < first:
                left.append((low, min(high, first - 1), line))
            if high > last:
                left.append((max(low, last + 1), high, line))
        self._runs = left

    def take(self) -> list[tuple[int, int, int]]:
        """Return what is left, and forget it."""
        left, self._runs = self._runs, []
        return left
