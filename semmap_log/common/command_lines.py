"""Command lines in messages, as a person can paste them into a shell."""

from __future__ import annotations

import shlex
from pathlib import Path

PROGRAM = "semmap-log"


def command_line(verb: str, *words: str | Path, program: str = PROGRAM) -> str:
    """Return a line that runs a verb; paths and words are quoted where a shell needs it.

    Words in capitals, such as DOOR, stand for what the reader fills in.

    Args:
        verb: Such as `recover`.
        *words: Its arguments and options; a path that begins like an option is written so that it
            is none.
        program: What runs it.
    """
    said = [_path(word) if isinstance(word, Path) else word for word in words]
    return shlex.join([program, verb, *said])


def _path(path: Path) -> str:
    text = str(path)
    return f"./{text}" if text.startswith("-") else text
