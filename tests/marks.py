"""The files that tell how far a log reached when a segment was closed: for tests."""

from __future__ import annotations

from pathlib import Path

OLD = "closed.json"
"""As versions before these files were named after what they tell."""


def marks(log: Path) -> list[Path]:
    """Return them, the farthest last."""
    named = log.glob("closed-*-*.json")
    old = [log / OLD] if (log / OLD).exists() else []
    return [*old, *sorted(named, key=lambda path: [int(n) for n in path.stem.split("-")[1:]])]


def remove_marks(log: Path) -> None:
    """Leave a log that does not tell how far it reached."""
    for path in marks(log):
        path.unlink()
