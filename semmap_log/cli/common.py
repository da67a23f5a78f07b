"""What all verbs share: arguments, output for people and for machines, progress, errors.

`--cache` and `--with` are for the verbs that read a log at a URL.
"""

from __future__ import annotations

import inspect
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from functools import wraps
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.sanitized_streams import json_text

if TYPE_CHECKING:
    from semmap_log.cli.printer import Printer
    from semmap_log.core.io.progress import Progress
    from semmap_log.core.io.url_path import UrlPath
    from semmap_log.core.model.doors import DoorId
    from semmap_log.core.model.moments import Time
    from semmap_log.log import About, DoorLog
    from semmap_log.views.palette import Palette


def a_file(path: Path | None) -> Path | None:
    """Return the path of a file to write; `-` is none.

    Raises:
        typer.BadParameter: It stands for standard output, which gets no files.
    """
    if path == Path("-"):
        raise typer.BadParameter("expected a file's name, got -; no file goes to standard output")
    return path


def a_local_log(path: Path) -> Path:
    """Return the path of a log that is written; a URL is none.

    Raises:
        typer.BadParameter: It is one.
    """
    from semmap_log.core.io.url_path import local_path
    from semmap_log.errors import LogError

    try:
        return local_path(path)
    except LogError as error:
        raise typer.BadParameter(str(error)) from None


def a_url(text: str) -> UrlPath:
    """Return the URL of a place in a store.

    Raises:
        typer.BadParameter: It is none.
    """
    from semmap_log.core.io.url_path import UrlPath, place_of
    from semmap_log.errors import LogError

    try:
        place = place_of(text)
    except LogError as error:
        raise typer.BadParameter(str(error), param_hint="URL") from None
    if not isinstance(place, UrlPath):
        raise typer.BadParameter(f"expected a URL such as s3://…, got {text}", param_hint="URL")
    return place


LogPath = Annotated[
    Path,
    typer.Argument(metavar="LOG", help="The log's folder; to read, a URL of it, too."),
]
AnyLogPath = Annotated[
    Path,
    typer.Argument(metavar="LOG", help="The log's folder, a URL, or an .mcap of it."),
]
WritableLog = Annotated[
    Path, typer.Argument(metavar="LOG", help="The log's folder.", callback=a_local_log)
]
OutFile = Annotated[
    Path,
    typer.Argument(metavar="OUT", help="The file; its name tells the format.", callback=a_file),
]
DoorName = Annotated[
    str,
    typer.Argument(metavar="DOOR", help="A door's id, name, or level/name; id:7: the id."),
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document, for machines.")]
At = Annotated[
    str | None,
    typer.Option("--at", metavar="TIME", help="What was true then, with all known today."),
]
KnownAt = Annotated[
    str | None,
    typer.Option("--known-at", metavar="TIME", help="Only what had been recorded by then."),
]
OfClass = Annotated[
    str | None,
    typer.Option(
        "--class", metavar="CLASS", help="Only objects of that class (`define`); door: all doors."
    ),
]
AsHappened = Annotated[
    bool,
    typer.Option("--as-happened", help="As if each event had been recorded when it happened."),
]
UpToEvent = Annotated[
    int | None, typer.Option("--event", metavar="N", help="Only events up to this number.")
]
Since = Annotated[
    str | None,
    typer.Option("--since", metavar="TIME", help="From then on; or T1..T2 (happened time)."),
]
Until = Annotated[
    str | None, typer.Option("--until", metavar="TIME", help="Before then (happened time).")
]


def range_of(log: DoorLog, since: str | None, until: str | None) -> tuple[Time, Time]:
    """Return the two ends of a range, of which `--since` may name both as T1..T2.

    Raises:
        typer.BadParameter: It does, and there is an --until as well.
        MomentError: They are not two moments, the earlier first.
    """
    if since is None or (until is None and ".." not in since):
        return since, until
    if until is None:
        return log.span(since)
    if ".." in since:
        raise typer.BadParameter(
            f"--since {since} names both ends; leave one of the two out", param_hint="--until"
        )
    return log.span(f"{since}..{until}")


def doors_meant(
    log: DoorLog, doors: list[str] | None, object_class: str | None
) -> list[DoorId] | None:
    """Return the doors that are named, or those of a class; None: all.

    Raises:
        typer.BadParameter: Both are given.
        UnknownDoorError: There is no such door, and never was.
        CommandError: There is no such class.
    """
    if object_class is None:
        return [log.resolve_any_door(name) for name in doors] if doors else None
    if doors:
        raise typer.BadParameter("name doors, or a class of them, not both", param_hint="--class")
    return log.ids_of_class(object_class)


class MapServer(str, Enum):
    """Whose reading of a map's pixels: `map_rules.RulesName`, as typer wants its choices."""

    nav2 = "nav2"
    nav2_humble = "nav2_humble"
    noetic = "noetic"


class PaletteName(str, Enum):
    """The keys of `views.palette.PALETTES`, as typer wants its choices."""

    default = "default"
    colour_blind = "colour-blind"

    @property
    def colours(self) -> Palette:
        """The palette of that name."""
        from semmap_log.views.palette import PALETTES

        return PALETTES[self.value]


PaletteChoice = Annotated[
    PaletteName,
    typer.Option("--palette", help="Colours of states; one stays apart for colour-blind eyes."),
]

PROGRESS_AFTER_S = 1.0
"""Shorter work needs no bar."""


def check_not_nan(**values: float | None) -> None:
    """Refuse a typed `nan`: what is not known is left out.

    Raises:
        typer.BadParameter: Names the option.
    """
    for name, value in values.items():
        if value is not None and math.isnan(value):
            option = f"--{name.replace('_', '-')}"
            raise typer.BadParameter("not a number; leave the option out", param_hint=option)


def console() -> Printer:
    """Return what prints tables on stdout: drawn in a terminal, a row a line elsewhere."""
    from semmap_log.cli.printer import Printer

    return Printer()


def say(text: str) -> None:
    """Print something that is not the verb's output."""
    typer.echo(text, err=True)


def print_empty_log_hint(opened: DoorLog) -> None:
    """Say what to do with a log that has no events yet."""
    from semmap_log.views.zone_times import how_to_begin

    if (hint := how_to_begin(opened)) is not None:
        say(hint)


def note_later_events(
    opened: DoorLog, at: str | None, known_at: str | None, *, door: DoorId | None = None
) -> None:
    """Note on stderr if events up to a moment were recorded later, as imported ones are."""
    from semmap_log.analysis.recorded_later import recorded_later

    if later := recorded_later(opened, at, known_at, door=door):
        say(later)


def check_recorded(
    opened: DoorLog,
    at: Time,
    known_at: Time,
    *,
    door: DoorId | None = None,
    remedy: str | None = None,
) -> None:
    """Refuse an empty answer where what happened then was only recorded later.

    Args:
        opened: The log.
        at: As it was given.
        known_at: As it was given.
        door: Which is not in the map then; None: none is.
        remedy: What to do: see `recorded_later`; None: as for a map.

    Raises:
        UnknownDoorError: Why no door is in the map then, and what to do.
    """
    from semmap_log.analysis.recorded_later import AT_ALONE, recorded_later
    from semmap_log.errors import UnknownDoorError

    if later := recorded_later(opened, at, known_at, door=door, remedy=remedy or AT_ALONE):
        who = (
            "no door is" if door is None else f"door {opened.door_labels().get(door, door)} is not"
        )
        raise UnknownDoorError(f"{who} in the map then. {later}")


def as_happened_line(verb: str, *words: str | PurePath) -> str:
    """Return the advice for beliefs about a time whose events were recorded later."""
    from semmap_log.core.texts import command_line

    return (
        "for what would have been believed had each event been recorded when it happened, type: "
        f'{command_line(verb, *words)} --at "{{then}}" --as-happened'
    )


def check_map_recorded(opened: DoorLog, at: Time, known_at: Time, event: int | None = None) -> None:
    """Refuse a moment at which no door is in the map, where what happened then was recorded later.

    Raises:
        UnknownDoorError: As `check_recorded`.
    """
    if (at, known_at) != (None, None) and not opened.replay(at, known_at, event).doors:
        check_recorded(opened, at, known_at)


def size_of(size: int) -> str:
    """Return a number of bytes in words."""
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"


def print_json(value: Any) -> None:
    """Print a value as one JSON document."""
    typer.echo(json_text(value, indent=2))


def print_json_list(values: Iterator[dict[str, Any]]) -> None:
    """Print a list as one JSON document, an item a line, without holding it in memory."""
    opening = "["
    for value in values:
        typer.echo(f"{opening}\n{json_text(value)}", nl=False)
        opening = ","
    typer.echo("[]" if opening == "[" else "\n]")


@contextmanager
def progress(
    doing: str, unit: str = "bytes", *, also: Callable[[], str] = str
) -> Iterator[Progress | None]:
    """Hand out a callback (done, in all) that draws a bar on stderr once the work takes a second.

    Args:
        doing: What is going on, such as `Reading`.
        unit: Of the numbers; `bytes` are shown as MB, `ns` as how much of the log's time.
        also: Called each time; returns what else to show.
    """
    if not sys.stderr.isatty():
        yield None
        return
    started = time.monotonic()
    bar: Any = None
    task: Any = None

    def show(done: int, total: int) -> None:
        nonlocal bar, task
        if bar is None and time.monotonic() - started > PROGRESS_AFTER_S:
            bar = _bar(unit)
            bar.start()
            task = bar.add_task(doing, total=total)
        if bar is not None:
            told = also()
            said = f"{doing}: {told}" if told else doing
            bar.update(task, completed=done, total=total, description=said)

    try:
        yield show
    finally:
        if bar is not None:
            bar.stop()


@contextmanager
def stopped_for_good() -> Iterator[None]:
    """Leave with exit code 2 where starting again would change nothing: no log, a wrong file.

    A supervisor that restarts a service after a failure needs to know when a restart is useless.
    """
    from semmap_log.errors import CommandError, FormatError, NotALogError, SigningError

    try:
        yield
    except (NotALogError, FormatError, CommandError, SigningError) as error:
        say(f"semmap-log: {error}")
        raise typer.Exit(2) from error


def on_stop(stop: Callable[[], object]) -> None:
    """Have signals ask for an end, instead of making one: what has come is finished.

    Ctrl-C, SIGTERM and, unless it is ignored as under `nohup`, the end of the terminal.
    """

    def asked(_number: int, _frame: object) -> None:
        stop()

    signal.signal(signal.SIGINT, asked)
    signal.signal(signal.SIGTERM, asked)
    hangup = getattr(signal, "SIGHUP", signal.SIGTERM)
    if signal.getsignal(hangup) is not signal.SIG_IGN:
        signal.signal(hangup, asked)


def _bar(unit: str) -> Any:
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
        TransferSpeedColumn,
    )
    from rich.text import Text

    from semmap_log.cli.printer import PlainConsole
    from semmap_log.core.model.moments import duration

    class RateColumn(ProgressColumn):
        """How much a second, as `TransferSpeedColumn` shows for bytes."""

        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed or 0
            if not speed:
                return Text()
            done = f"{duration(int(speed))} of the log" if unit == "ns" else f"{speed:,.0f} {unit}"
            return Text(f"{done}/s")

    amount: dict[str, list[ProgressColumn]] = {
        "bytes": [DownloadColumn(), TransferSpeedColumn()],
        "ns": [TaskProgressColumn(), RateColumn()],
    }
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        *amount.get(unit, [MofNCompleteColumn(), RateColumn()]),
        TimeRemainingColumn(),
        console=PlainConsole(sys.stderr),
        transient=True,
    )


_ABOUT = {
    "at": Annotated[
        str | None, typer.Option("--at", metavar="TIME", help="When it happened; default: now.")
    ],
    "actor": Annotated[str, typer.Option("--actor", help="Who did it.")],
    "source": Annotated[str, typer.Option("--source", help="Which sensor, robot or file.")],
    "reason": Annotated[str, typer.Option("--reason", help="Why.")],
    "correlation": Annotated[str, typer.Option("--correlation", help="What it belongs to.")],
    "command_id": Annotated[
        str,
        typer.Option(
            "--command-id",
            metavar="HEX",
            help="32 hex digits: the same command, sent again, is stored once.",
        ),
    ],
    "expected_event": Annotated[
        int | None,
        typer.Option(
            "--expected-event",
            metavar="N",
            help="Only if N is still the last event about this door (new doors, rounds: of all).",
        ),
    ],
}


def takes_about(command: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the options of every command (when, who, why); it gets them as `about`.

    A verb that asks about a moment keeps its own --at.
    """
    own = inspect.signature(command).parameters

    @wraps(command)
    def verb(**values: Any) -> None:
        about: About = {
            "actor": values.pop("actor"),
            "source": values.pop("source"),
            "reason": values.pop("reason"),
            "correlation": values.pop("correlation"),
            "command_id": _command_id(values.pop("command_id")),
            "expected_event": values.pop("expected_event"),
        }
        if "at" not in own:
            about["at"] = values.pop("at")
        command(**values, about=about)

    asked = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=hint,
                          default=None if name in ("at", "expected_event") else "")
        for name, hint in _ABOUT.items()
        if name not in own
    ]  # fmt: skip
    parameters = [
        p.replace(kind=inspect.Parameter.KEYWORD_ONLY,
                  annotation=eval(p.annotation, command.__globals__))  # noqa: S307 - our own text
        for p in own.values()
        if p.name != "about"
    ]  # fmt: skip
    verb.__signature__ = inspect.Signature([*parameters, *asked])  # type: ignore[attr-defined]
    verb.__annotations__ = {p.name: p.annotation for p in [*parameters, *asked]}
    del verb.__wrapped__  # or its own signature would be read
    return verb


def _command_id(text: str) -> bytes | None:
    if not text:
        return None
    try:
        command_id = bytes.fromhex(text)
    except ValueError:
        command_id = b""
    if len(command_id) != 16:
        raise typer.BadParameter(
            f"expected 32 hexadecimal digits, got {text!r}", param_hint="--command-id"
        )
    return command_id


CacheFolder = Annotated[
    Path | None,
    typer.Option(
        "--cache",
        metavar="DIR",
        help="Of a URL: keep there what is fetched; also by SEMMAP_LOG_CACHE.",
    ),
]


RestAt = Annotated[
    str | None,
    typer.Option(
        "--with",
        metavar="URL",
        help="Read there what `ship --keep-days` removed here; also by SEMMAP_LOG_WITH.",
    ),
]


def with_cache(command: Callable[..., None], *, caches: bool = True) -> Callable[..., None]:
    """Give a verb `--cache` and `--with` if it takes a URL of a log; else return it as it is.

    Args:
        command: The verb.
        caches: Whether it gets `--cache`, too.
    """
    own = inspect.signature(command, eval_str=True).parameters.values()
    if not any(p.annotation in (LogPath, AnyLogPath) for p in own):
        return command

    @wraps(command)
    def verb(*, rest_at: str | None, cache: Path | None = None, **values: Any) -> None:
        folder = None if cache is None else str(cache.absolute())
        url = None if rest_at is None else str(a_url(rest_at))
        with _named("SEMMAP_LOG_CACHE", folder), _named("SEMMAP_LOG_WITH", url):
            command(**values)

    parameters = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in own]
    parameters += [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind, default=None)
        for name, kind in (("cache", CacheFolder), ("rest_at", RestAt))
        if caches or name != "cache"
    ]
    verb.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    verb.__annotations__ = {p.name: p.annotation for p in parameters}
    del verb.__wrapped__  # or its own signature would be read
    return verb


@contextmanager
def _named(variable: str, value: str | None) -> Iterator[None]:
    """Name something in the environment, for this process and those that it starts."""
    if value is None:
        yield
        return
    before = os.environ.get(variable)
    os.environ[variable] = value
    try:
        yield
    finally:
        if before is None:
            del os.environ[variable]
        else:
            os.environ[variable] = before
