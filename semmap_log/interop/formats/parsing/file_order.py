"""Which instant a time means that a wall clock shows twice: the order of the file tells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(slots=True)
class FileOrder:
    """Goes along with the times of a file, or of a stream, and decides those that are not clear."""

    tz: str
    """The zone whose clock it is."""
    first: int = 0
    """So many times were taken for the first coming of the hour that comes twice."""
    second: int = 0
    """So many for the second."""
    _last_ns: int = 0
    _runs_forward: bool = True
    """No time was earlier than one before it."""

    def chosen(self, first_ns: int, second_ns: int, *, own_last_ns: int = 0) -> int:
        """Return the instant that the next time means: the first that keeps the order.

        Args:
            first_ns: What it can mean.
            second_ns: What else it can mean; elsewhere than in the hour that comes twice the same.
            own_last_ns: The last time of what it is about, such as its door. It alone counts in a
                file whose times run backwards.
        """
        chosen_ns = first_ns
        if first_ns != second_ns:
            last_ns = self._last_ns if self._runs_forward else 0
            if last_ns > second_ns:
                last_ns = own_last_ns
            if max(last_ns, own_last_ns) > first_ns:
                chosen_ns = second_ns
            self.second += chosen_ns == second_ns
            self.first += chosen_ns == first_ns
        self._runs_forward &= chosen_ns >= self._last_ns
        self._last_ns = max(self._last_ns, chosen_ns)
        return chosen_ns

    def pass_clear(self, times: NDArray[np.int64]) -> None:
        """Take note of the next times, which are clear."""
        self._runs_forward &= bool(times[0] >= self._last_ns and (np.diff(times) >= 0).all())
        self._last_ns = max(self._last_ns, int(times.max()))

    def warnings(self) -> tuple[str, ...]:
        """Return how many times were not clear, and for what they were taken; nothing: none."""
        count = self.first + self.second
        if not count:
            return ()
        told = (
            f"times in the hour that comes twice in {self.tz}: {count:,}; by the order of the file "
            f"{self.first:,} taken for its first coming, {self.second:,} for its second; times "
            "with an offset are clear"
        )
        return (told,)
