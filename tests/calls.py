"""What a piece of work costs on any machine: how many functions it calls, and which."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from types import FrameType
from typing import Any

MOST_CALLS_A_LOOK = 130
"""At a log in which nothing happens: what is asked of its folder, and of its last file."""


def calls_of(work: Callable[[], object]) -> Counter[str]:
    """Do it; return how often it called functions of each name, those written in C, too.

    Whatever goes through a million rows one by one calls something for each of them.
    """
    calls: Counter[str] = Counter()

    def note(frame: FrameType, event: str, called: Any) -> None:
        if event == "call":
            calls[frame.f_code.co_name] += 1
        elif event == "c_call":
            calls[called.__name__] += 1

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(before)
    return calls
