"""The one place that says why a verb failed: a line for people, or with --json a document.

    {"error": {"kind": "UnknownDoorError", "message": "…", "exit_code": 1}}

`kind` is the name of the error's class (`semmap_log.errors`), `UsageError` for a command line that
cannot be, or the class of an error of the system. An error of a file's lines also has `problems`:
[{"text", "count", "lines", "last_line"}], those that are the same but for their values as one.

The document is on stdout, in the place of the answer. Where a part of the answer is out already,
as of `history --json` on a log with damage in its middle, it is the last line of stderr.
"""

from __future__ import annotations

import sys
from typing import Any

import typer

from semmap_log.cli.plain_streams import PlainStream, json_text
from semmap_log.core.texts import Repeats
from semmap_log.errors import FormatError

_USAGE_ERROR: type[Exception]
CLICK_ERROR: type[Exception]
_USAGE_ERROR, CLICK_ERROR = typer.BadParameter.__mro__[1:3]
"""Their names are in another package in each version of typer."""


def asks_for_json(arguments: list[str]) -> bool:
    """Tell whether --json is among the options; how, a wrong command line cannot say itself."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    return "--json" in arguments[:end]


def fail(error: BaseException, *, as_json: bool, is_output_lost: bool = False) -> int:
    """Say why, and return the exit code: 1, or 2 where the command line is wrong.

    Args:
        error: Why.
        as_json: As a document.
        is_output_lost: Not on stdout, which may be what failed.
    """
    code: int = getattr(error, "exit_code", 1)
    if as_json:
        _tell_machine(error, code, is_output_lost=is_output_lost)
    elif isinstance(error, CLICK_ERROR):
        error.show()  # type: ignore[attr-defined]
    else:
        tell(f"{error}")
    return code


def tell(text: str) -> None:
    """Tell the person what went wrong."""
    print(f"semmap-log: {text}", file=sys.stderr)  # noqa: T201


def problems_to_json(found: Repeats) -> list[dict[str, Any]]:
    """Return problems by kind, as the JSON of an error, or of `record`, has them."""
    return [
        {
            "text": kind.kept[0][1],
            "count": kind.count,
            "lines": [line for line, _ in kind.kept],
            "last_line": kind.last_line,
        }
        for kind in found
    ]


def _tell_machine(error: BaseException, code: int, *, is_output_lost: bool) -> None:
    document: dict[str, Any] = {
        "kind": _kind(error),
        "message": error.format_message() if isinstance(error, CLICK_ERROR) else str(error),  # type: ignore[attr-defined]
        "exit_code": code,
    }
    if isinstance(error, FormatError) and error.repeats:
        document["problems"] = problems_to_json(error.repeats)
    has_begun = isinstance(sys.stdout, PlainStream) and sys.stdout.has_begun
    if has_begun or is_output_lost:
        print(json_text({"error": document}), file=sys.stderr)  # noqa: T201
    else:
        print(json_text({"error": document}, indent=2))  # noqa: T201


def _kind(error: BaseException) -> str:
    return "UsageError" if isinstance(error, _USAGE_ERROR) else type(error).__name__
