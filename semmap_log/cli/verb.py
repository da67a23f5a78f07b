"""Turns a function into a verb: old spellings, help that is made on demand, suggestions.

Help is plain text, as that of any Unix program: no frames, and quick.

A verb's failure is reported here alone: as a line for people, or with --json as a document.

    {"error": {"kind": "UnknownDoorError", "message": "…", "exit_code": 1}}

`kind` is the name of the error's class (`semmap_log.errors`), `UsageError` for a wrong command
line, or the class of an error of the system. An error of a file's lines also has `problems`:
[{"text", "count", "lines", "last_line"}], one for all that differ only in their values.

The document is on stdout, in the place of the answer. Where a part of the answer is out already,
as of `history --json` on a log with damage in its middle, it is the last line of stderr.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import typer
from typer import core
from typer.core import TyperCommand

from semmap_log.cli.completion import OFFERS, Offers
from semmap_log.cli.plain_values import with_plain_readers
from semmap_log.cli.sanitized_streams import PlainStream, json_text
from semmap_log.core.lazily import late_pattern
from semmap_log.core.texts import Repeats
from semmap_log.errors import FormatError

_USAGE_ERROR: type[Exception]
CLICK_ERROR: type[Exception]
_USAGE_ERROR, CLICK_ERROR = typer.BadParameter.__mro__[1:3]
"""Their names are in another package in each version of typer."""


def asks_for_json(arguments: list[str]) -> bool:
    """Return whether --json is among the options, also of a command line that cannot be parsed."""
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
        _print_json_error(error, code, is_output_lost=is_output_lost)
    elif isinstance(error, CLICK_ERROR):
        error.show()  # type: ignore[attr-defined]
    else:
        tell(f"{error}")
    return code


def tell(text: str) -> None:
    """Print what went wrong."""
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


def _print_json_error(error: BaseException, code: int, *, is_output_lost: bool) -> None:
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


OLD_SPELLINGS = {"--from": "--since", "--to": "--until"}
"""Of ranges of time: still taken by every verb that has no such option of its own."""

NEED_NO_VALUE = {"--scan": re.compile(r"(/\w+)+", re.ASCII)}
"""Options that may stand alone -> what their values look like."""

TAKE_PLACES = {"go"}
"""Verbs with places as arguments; one at a negative x looks like an option."""
NEGATIVE_PLACE = late_pattern(r"-[\d.]+,.+", re.ASCII)

POINT = "X,Y"
"""How help shows an option that takes a point."""
NUMBER = late_pattern(r"[+-]?[\d.]+(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)

HELP_MADE_LATE: dict[str, Callable[[], str]] = {}
"""Verb -> what makes the end of its help; called only for the help, since it is slow."""


class Verb(TyperCommand):
    """A verb."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for param in self.params:
            if offer := OFFERS.get(param.name or ""):
                param.shell_complete = partial(offered, offer)  # type: ignore[method-assign]

    def get_params(self, ctx: Any) -> Any:
        """Return the options and arguments, `--help` among them."""
        return with_plain_readers(super().get_params(ctx))

    def make_parser(self, ctx: Any) -> Any:
        """Return the parser, which takes old spellings, too; help shows the new ones only."""
        parser: Any = super().make_parser(ctx)
        options: dict[str, Any] = {
            spelling: option for option in self.params for spelling in option.opts
        }
        for old, new in OLD_SPELLINGS.items():
            if new in options and old not in options:
                parser.add_option(options[new], [old], dest=options[new].name)
        return parser

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """Take up the command line; of a word that is no option, say which may be meant."""
        try:
            given = _with_places(args) if self.name in TAKE_PLACES else args
            self._check_split_points(given)
            return super().parse_args(ctx, _with_values(given))
        except CLICK_ERROR as error:
            if hasattr(error, "possibilities") and hasattr(error, "option_name"):
                error.possibilities = self._similar(error.option_name)
            raise

    def _check_split_points(self, args: list[str]) -> None:
        """Refuse a point as two numbers: the second would be taken for another argument.

        Raises:
            typer.BadParameter: It says what to type.
        """
        points = {name for param in self.params if param.metavar == POINT for name in param.opts}
        for option, x, y in zip(args, args[1:], args[2:], strict=False):
            if option in points and NUMBER.fullmatch(x) and NUMBER.fullmatch(y):
                raise typer.BadParameter(
                    f"expected {POINT}, got two numbers; type: {option} {x},{y}", param_hint=option
                )

    def _similar(self, option: str) -> list[str]:
        """Return the options of a like name that help shows: no hidden ones, no old spellings."""
        from difflib import get_close_matches

        shown = (param for param in self.params if not getattr(param, "hidden", False))
        named = [name for param in shown for name in (*param.opts, *param.secondary_opts)]
        return get_close_matches(option, [name for name in named if name.startswith("--")])

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write what is made late of this verb's help."""
        if self.name in HELP_MADE_LATE:
            formatter.write_paragraph()
            formatter.write(HELP_MADE_LATE[self.name]())
        super().format_epilog(ctx, formatter)


def _with_places(args: list[str]) -> list[str]:
    """Return a command line in which places at a negative x are no options: with a blank before."""
    return [f" {arg}" if NEGATIVE_PLACE.fullmatch(arg) else arg for arg in args]


def _with_values(args: list[str]) -> list[str]:
    """Return a command line in which the options have a value that need none: an empty one.

    The next word is such a value where it can be one, and is no file that there is.
    """
    end = args.index("--") if "--" in args else len(args)
    made = []
    for word, following in zip(args[:end], [*args[1:end], ""], strict=False):
        made.append(word)
        form = NEED_NO_VALUE.get(word)
        if form is not None and (not form.fullmatch(following) or Path(following).exists()):
            made.append("")
    return made + args[end:]


def offered(offer: Callable[[Any, str], Offers], ctx: Any, incomplete: str) -> list[Any]:
    """Return what a shell is offered, as typer wants it."""
    item: Any = getattr(core, "CompletionItem", None)
    if item is None:  # an older typer, which needs click
        item = core.click.shell_completion.CompletionItem  # type: ignore[attr-defined]
    return [item(word, help=said or None) for word, said in offer(ctx, incomplete)]
