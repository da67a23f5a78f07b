"""`--cache` of the verbs that read a log at a URL."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from semmap_log.cli.common import AnyLogPath, LogPath

CacheFolder = Annotated[
    Path | None,
    typer.Option(
        "--cache",
        metavar="DIR",
        help="Of a URL: keep there what is fetched; also by SEMMAP_LOG_CACHE.",
    ),
]


def with_cache(command: Callable[..., None]) -> Callable[..., None]:
    """Give a verb `--cache` if it takes a URL of a log; else return it as it is."""
    own = inspect.signature(command, eval_str=True).parameters.values()
    if not any(p.annotation in (LogPath, AnyLogPath) for p in own):
        return command

    @wraps(command)
    def verb(*, cache: Path | None, **values: Any) -> None:
        with _cached_in(cache):
            command(**values)

    parameters = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in own]
    parameters.append(
        inspect.Parameter(
            "cache", inspect.Parameter.KEYWORD_ONLY, annotation=CacheFolder, default=None
        )
    )
    verb.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    verb.__annotations__ = {p.name: p.annotation for p in parameters}
    del verb.__wrapped__  # or its own signature would be read
    return verb


@contextmanager
def _cached_in(folder: Path | None) -> Iterator[None]:
    """Name a folder in the environment, for this process and those that it starts."""
    if folder is None:
        yield
        return
    from semmap_log.io.object_cache import VARIABLE

    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(folder.absolute())
    try:
        yield
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before
