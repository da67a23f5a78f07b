"""`help`: what a verb does, or what verbs there are."""

from __future__ import annotations

from typing import Annotated, Any

import typer


def run(
    ctx: typer.Context,
    verb: Annotated[
        list[str] | None,
        typer.Argument(metavar="VERB", help="The verb; of one that has verbs of its own, both."),
    ] = None,
    *,
    all_verbs: Annotated[bool, typer.Option("--all", help="All verbs, in groups.")] = False,
) -> None:
    """Show what a verb does, or what verbs there are.

    \b
    Examples:
      semmap-log help
      semmap-log help replay
      semmap-log help --all
    """
    if all_verbs and verb:
        raise typer.BadParameter("shows all; leave it out, or the verb", param_hint="--all")
    shown: Any = ctx.find_root()
    if all_verbs:
        formatter = shown.make_formatter()
        shown.command.format_all_commands(formatter)
        typer.echo(formatter.getvalue().strip("\n"))
        return
    words = list(verb or ())
    while words:
        name, command, words = shown.command.resolve_command(shown, words)
        shown = type(shown)(command, info_name=name, parent=shown)
        if words and not hasattr(command, "resolve_command"):
            raise typer.BadParameter(f"{name} has no verbs of its own; got {words[0]!r}",
                                     param_hint="VERB")  # fmt: skip
    typer.echo(shown.get_help())
