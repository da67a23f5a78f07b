"""Where the answers of earlier runs are kept.

    <folder>/<job>-<parameters>/<place>-<log id>-<head>.answer

Nothing here needs what the jobs need: whoever takes records out of a log removes its answers, too.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

SUFFIX = ".answer"
_DIGITS = 16


def default_folder() -> Path:
    """Return the default folder for answers."""
    cache = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(cache).expanduser() / "semmap-log" / "fleet"


def digits_of(text: str) -> str:
    """Return the digits that stand for a text in a file name."""
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:_DIGITS]


def answer_name(place: str, log_id: str, head: str) -> str:
    """Return the name of a log's answer."""
    return f"{digits_of(place)}-{log_id[:_DIGITS]}-{head[:_DIGITS]}{SUFFIX}"


def answers_of(log_id: str, folder: Path) -> Iterator[Path]:
    """Yield the answers of a log to all questions, including unfinished ones."""
    yield from sorted(folder.glob(f"*/*-{log_id[:_DIGITS]}-*{SUFFIX}*"))
