"""How much time lies in stretches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.int64]


def covered_ns(start_ns: Times, end_ns: Times, times_ns: Times) -> Times:
    """Return how much of the stretches lies before each time, nanoseconds.

    Args:
        start_ns: (m,), ascending.
        end_ns: (m,), <= the next start.
        times_ns: (n,).
    """
    if not len(start_ns):
        return np.zeros(len(times_ns), np.int64)
    before_ns = np.append(0, np.cumsum(end_ns - start_ns))
    last = np.searchsorted(start_ns, times_ns, "right") - 1
    inside_ns = np.minimum(times_ns, end_ns[last]) - start_ns[last]
    return np.where(last < 0, 0, before_ns[last] + inside_ns)
