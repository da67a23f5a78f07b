"""A log's events as JSON lines, with all that `import` needs to make the same log of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Commit
from semmap_log.interop.formats.json.event_json import line_to_json
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.replay.kept_commits import happened_by
from semmap_log.log.replay.replay import Scope
from semmap_log.store.reading.window import Window

TOLD_EVERY = 1000
"""Commits between two words of progress."""


@dataclass(slots=True)
class WrittenLines:
    """How much was written."""

    events: int = 0
    retracted: int = 0
    """So many of them were taken back, by what is known in the scope."""


def write_event_lines(
    log: DoorLog,
    path: Path,
    scope: Scope,
    *,
    progress: Progress | None = None,
) -> WrittenLines:
    """Write the events of a scope, numbers ascending, retracted ones marked.

    A retraction counts whenever it happened, as it does for every question about the scope. The
    first line also tells the log's time zone. What stands for events that the log no longer keeps
    is told, too: a log that is made of the lines answers as this one does, from its horizon on.

    Args:
        log: The log.
        path: The file.
        scope: Which events.
        progress: Told how many of the events are done.

    Raises:
        HorizonError: The scope ends before the log's horizon.
    """
    retractions = log.retractions(log.limit_of(scope))
    written, zone = WrittenLines(), {"timezone": log.info.timezone}
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for batch, commit_of in _told(log, scope, progress):
            hidden = retractions.hidden(batch).tolist()
            for recorded, retracted in zip(batch, hidden, strict=True):
                commit = commit_of(recorded.number)
                file.write(_line(zone | line_to_json(recorded, commit, retracted=retracted)))
                zone = {}
                written.events += 1
                written.retracted += retracted
    return written


CommitOf = Callable[[int], Commit]
"""Returns the commit of an event, by its number."""


def _told(
    log: DoorLog, scope: Scope, progress: Progress | None
) -> Iterator[tuple[EventBatch, CommitOf]]:
    """Yield what is told: in large batches where the log keeps all, which is quicker."""
    if not log.horizon():
        finder, limit = log.commit_finder(), log.limit_of(scope)
        if limit is None or limit >= 0:
            window = Window.up_to(at_ns=None, event=limit)
            for batch in log.batches_in(window, progress=progress, on_page=finder.look_at):
                chosen = batch if scope.at_ns is None else happened_by(batch, scope.at_ns)
                yield chosen, finder.commit_at
        return
    total = log.last_event() + 1
    for place, followed in enumerate(log.kept_commits(scope)):
        yield followed.batch, partial(_that, followed.commit)
        if progress is not None and place % TOLD_EVERY == 0:
            progress(followed.commit.last_event, total)


def _that(commit: Commit, _: int) -> Commit:
    return commit


def _line(shown: dict[str, Any]) -> str:
    return json.dumps(shown, ensure_ascii=False, allow_nan=False) + "\n"
