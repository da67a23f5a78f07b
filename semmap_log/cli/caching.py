"""`--cache` and `--with` of the verbs that read a log at a URL."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from semmap_log.cli.common import AnyLogPath, LogPath, a_url

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
