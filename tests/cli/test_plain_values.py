"""Plain values of a command line: read as typer reads them, without what typer loads for it."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from typer.core import TyperCommand

from semmap_log.cli.plain_values import with_plain_readers


class Colour(str, Enum):
    """Some choices."""

    red = "red"
    blue = "blue"


class Plain(TyperCommand):
    """A command that reads its values plainly."""

    def get_params(self, ctx: Any) -> Any:
        """Return the options, as `Verb` does."""
        return with_plain_readers(super().get_params(ctx))


def _command(cls: type[TyperCommand]) -> Any:
    app = typer.Typer(rich_markup_mode=None)

    @app.command(cls=cls)
    def run(
        path: Annotated[Path, typer.Argument()],
        words: Annotated[list[str] | None, typer.Argument()] = None,
        *,
        text: Annotated[str, typer.Option()] = "as it is",
        maybe: Annotated[str | None, typer.Option()] = None,
        count: Annotated[int, typer.Option(min=1, max=9)] = 3,
        share: Annotated[float | None, typer.Option(min=0, max=1)] = None,
        any_number: Annotated[float, typer.Option()] = 0.5,
        colour: Annotated[Colour, typer.Option()] = Colour.red,
        shout: Annotated[bool, typer.Option("--shout")] = False,
    ) -> list[Any]:
        return [path, words, text, maybe, count, share, any_number, colour, shout]

    return typer.main.get_command(app)


def _read(cls: type[TyperCommand], *line: str) -> tuple[list[Any], list[type]] | str:
    """Return the values and their types, or what is said of a wrong line."""
    try:
        values = _command(cls).main(list(line), standalone_mode=False)
    except Exception as error:  # noqa: BLE001  # typer's own, which its versions have under different names
        return f"{type(error).__name__}: {getattr(error, 'message', error)}"
    return values, [type(value) for value in values]


LINES = [
    ("x",), ("x", "a", "b"), ("x", "--text", ""), ("x", "--text", " 7 "), ("x", "--maybe", "y"),
    ("x", "--count", "9"), ("x", "--count", "0"), ("x", "--count", "10"), ("x", "--count", "-1"),
    ("x", "--count", "007"), ("x", "--count", " 4"), ("x", "--count", "4.0"),
    ("x", "--count", "1_0"), ("x", "--count", "four"), ("x", "--count", ""),
    ("x", "--share", "1"), ("x", "--share", ".5"), ("x", "--share", "0.25"),
    ("x", "--share", "1.01"), ("x", "--share", "nan"), ("x", "--any-number", "-0"),
    ("x", "--any-number", "-12.50"), ("x", "--any-number", "1e3"), ("x", "--any-number", "inf"),
    ("x", "--any-number", "٣"), ("x", "--count", "٣"), ("x", "--colour", "blue"),
    ("x", "--colour", "Blue"), ("x", "--shout"), ("",), ("x/../y",), ("~",), ("-",),
]  # fmt: skip


@pytest.mark.parametrize("line", LINES, ids=" ".join)
def test_it_reads_what_typer_reads(line: tuple[str, ...]) -> None:
    """The same values of the same types, and the same words about wrong ones."""
    assert _read(TyperCommand, *line) == _read(Plain, *line)


def test_a_path_that_may_not_be_read_is_typers_to_refuse(tmp_path: Path) -> None:
    """Whoever may read everything reads it."""
    path = tmp_path / "secret"
    path.touch(mode=0)

    assert _read(TyperCommand, str(path)) == _read(Plain, str(path))
