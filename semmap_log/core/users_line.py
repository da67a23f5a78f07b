"""Warnings point at the line of whoever called this package, however deep in it they arise."""

from __future__ import annotations

from inspect import currentframe


def frames_of_ours() -> int:
    """Return how many calls of this package, the one of this function included, lie before that.

    It is what `warnings.warn` wants as `stacklevel` from the caller of this function.
    """
    frame = currentframe()
    count = 0
    while frame is not None and str(frame.f_globals.get("__name__")).startswith("semmap_log."):
        frame, count = frame.f_back, count + 1
    return count
