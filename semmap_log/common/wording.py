"""Words of messages that depend on a number."""

from __future__ import annotations


def counted(number: int, what: str) -> str:
    """Return how many of a thing: `1 event`, `2,000 events`."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"
