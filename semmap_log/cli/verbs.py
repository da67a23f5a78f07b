"""What makes a verb of a function: its old spellings, help that is made when asked for, its group.

Help is plain text, as that of any Unix program: no frames, and quick.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from typer import core
from typer.core import TyperCommand, TyperGroup

from semmap_log.cli.completion import OFFERS, Offers
from semmap_log.cli.failures import CLICK_ERROR
from semmap_log.cli.plain_streams import READER_GONE, forget_output

OLD_SPELLINGS = {"--from": "--since", "--to": "--until"}
"""Of ranges of time: still taken by every verb that has no such option of its own."""

NEED_NO_VALUE = {"--scan": re.compile(r"(/\w+)+", re.ASCII)}
"""Options that may stand alone -> what their values look like."""

TAKE_PLACES = {"go"}
"""Verbs with places as arguments; one at a negative x looks like an option."""
NEGATIVE_PLACE = re.compile(r"-[\d.]+,.+", re.ASCII)

HELP_MADE_LATE: dict[str, Callable[[], str]] = {}
"""Verb -> what makes the end of its help, which is asked for only then: it is slow to make."""


class Verb(TyperCommand):
    """A verb."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for param in self.params:
            if offer := OFFERS.get(param.name or ""):
                param.shell_complete = partial(_offered, offer)  # type: ignore[method-assign]

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
            return super().parse_args(ctx, _with_values(given))
        except CLICK_ERROR as error:
            if hasattr(error, "possibilities") and hasattr(error, "option_name"):
                error.possibilities = self._similar(error.option_name)
            raise

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


class Verbs(TyperGroup):
    """The program: its verbs in groups, each under a head."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for param in self.params:
            if param.name == "install_completion" and param.callback is not None:
                param.callback = partial(_uncoloured, param.callback)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the verbs, group after group, in the order in which they were added."""
        verbs = [(name, self.commands[name]) for name in self.list_commands(ctx)]
        shown = [(name, verb) for name, verb in verbs if not verb.hidden]
        widest = max(len(name) for name, _ in shown)
        groups: dict[str, list[tuple[str, str]]] = {}
        for name, verb in shown:
            said = verb.get_short_help_str(formatter.width - 6 - widest)
            groups.setdefault(_group_of(verb), []).append((f"{name:<{widest}}", said))
        for group, rows in groups.items():
            with formatter.section(group):
                formatter.write_dl(rows)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the verb that a word means; of one that is none, say which may be meant."""
        try:
            return super().resolve_command(ctx, args)
        except CLICK_ERROR as error:
            if args[0].startswith("-"):
                raise
            from difflib import get_close_matches

            shown = [name for name in self.list_commands(ctx) if not self.commands[name].hidden]
            close = get_close_matches(args[0], shown)
            meant = f" Did you mean {' or '.join(close)}?" if close else ""
            # typer's own text, where it has one, offers hidden names, too
            error.message = f"No such command {args[0]!r}.{meant}"  # type: ignore[attr-defined]
            raise

    def make_context(self, *args: Any, **kwargs: Any) -> Any:
        """Return the context of a command line; it may print help, whose reader may go."""
        with _reader_may_go():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: Any) -> Any:
        """Run the verb."""
        with _reader_may_go():
            done = super().invoke(ctx)
            sys.stdout.flush()
            return done


def _uncoloured(tell: Callable[..., Any], ctx: Any, param: Any, value: Any) -> Any:
    """Call what typer prints something by, in a colour that `plain_streams` would spell out."""
    ctx.color = False
    return tell(ctx, param, value)


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


def _offered(offer: Callable[[Any, str], Offers], ctx: Any, incomplete: str) -> list[Any]:
    """Return what a shell is offered, as typer wants it."""
    item: Any = getattr(core, "CompletionItem", None)
    if item is None:  # an older typer, with click beside it
        item = core.click.shell_completion.CompletionItem  # type: ignore[attr-defined]
    return [item(word, help=said or None) for word, said in offer(ctx, incomplete)]


def _group_of(verb: Any) -> str:
    group = verb.rich_help_panel
    return group if isinstance(group, str) else "Commands"


@contextmanager
def _reader_may_go() -> Iterator[None]:
    """End quietly, as `cat` does, when the reader of our output has gone.

    Here, since typer would end with exit code 1.
    """
    try:
        yield
    except BrokenPipeError:
        forget_output()
        sys.exit(READER_GONE)
