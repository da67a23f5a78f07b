"""The program as typer has it: finds its verbs, and shows them in groups, each under a heading."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from semmap_log.cli.completion import Offers
from semmap_log.cli.plain_values import with_plain_readers
from semmap_log.cli.sanitized_streams import READER_GONE, forget_output
from semmap_log.cli.verb import CLICK_ERROR, offered
from semmap_log.cli.verb_table import FIRST_WEEK, GROUPS, SHOWN, VerbsByName


class Verbs(TyperGroup):
    """The program: its verbs in groups, each under a head."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.commands = VerbsByName()  # type: ignore[assignment]  # typer only looks up
        for param in self.params:
            if param.name == "install_completion" and param.callback is not None:
                param.callback = partial(_uncoloured, param.callback)

    def get_params(self, ctx: Any) -> Any:
        """Return the options and arguments, `--help` among them."""
        return with_plain_readers(super().get_params(ctx))

    def list_commands(self, _: Any) -> list[str]:
        """Return the names of the verbs, in the order in which help shows them."""
        return list(self.commands)

    def format_commands(self, _: Any, formatter: Any) -> None:
        """Write the verbs of the first week, and where the others are; none is loaded for it."""
        widest = max(map(len, FIRST_WEEK))
        with formatter.section("The verbs of the first week"):
            formatter.write_dl([(f"{name:<{widest}}", SHOWN[name]) for name in FIRST_WEEK])
        with formatter.section("More"):
            formatter.write_dl(
                [
                    ("semmap-log help VERB", "What a verb does, with examples."),
                    ("semmap-log help --all", f"All {len(SHOWN)} verbs, in groups."),
                ]
            )

    def format_all_commands(self, formatter: Any) -> None:
        """Write all verbs, group after group; none is loaded for it."""
        widest = max(map(len, SHOWN))
        for group, verbs in GROUPS.items():
            with formatter.section(group):
                formatter.write_dl([(f"{name:<{widest}}", does) for name, does in verbs.items()])

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Return what a shell is offered: verbs, of which none is loaded for it, or options."""
        if incomplete.startswith("-"):
            return super().shell_complete(ctx, incomplete)
        return offered(_verbs_beginning, ctx, incomplete)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the verb that a word means; of one that is none, say which may be meant."""
        try:
            return super().resolve_command(ctx, args)
        except CLICK_ERROR as error:
            if args[0].startswith("-"):
                raise
            from difflib import get_close_matches

            close = get_close_matches(args[0], SHOWN)
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


def _verbs_beginning(_: Any, incomplete: str) -> Offers:
    return [(name, does) for name, does in SHOWN.items() if name.startswith(incomplete)]


def _uncoloured(tell: Callable[..., Any], ctx: Any, param: Any, value: Any) -> Any:
    """Call what typer prints something by, in a colour that `sanitized_streams` would spell out."""
    ctx.color = False
    return tell(ctx, param, value)


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


app = typer.Typer(
    cls=Verbs,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "color": True},
)


def _version(asked: bool) -> None:  # noqa: FBT001 - typer's callback
    if asked:
        from importlib.metadata import version

        from semmap_log.core.loops import compiled

        loops = "without compiled loops" if compiled() is None else "with compiled loops"
        typer.echo(f"semmap-log {version('semmap-log')} ({loops})")
        raise typer.Exit


@app.callback()
def semmap_log(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """The flight recorder of a robot's door map.

    Every change and every sighting of a door is an event in an append-only MCAP log; the door
    map of any moment is replayed from it.

    \b
    Examples:
      semmap-log demo                          the main job in one go
      semmap-log init office --tz Europe/Vienna
      semmap-log add office --x 2 --y 1.5 --theta 0 --width 0.9 --name front
      semmap-log observe office front open --accuracy 0.9
      semmap-log replay office --at "2h ago"
      semmap-log view office
    """
