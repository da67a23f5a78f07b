"""A log's events as JSON lines, with all that `import` needs to make the same log of them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semmap_log.batches.event_batch import EventBatch
from semmap_log.door_log.door_log import DoorLog
from semmap_log.formats.json.event_json import line_to_json
from semmap_log.io.progress import Progress
from semmap_log.replay.kept_commits import happened_by
from semmap_log.replay.replay import Scope
from semmap_log.store.reading.reader import OnPage
from semmap_log.store.reading.window import Window


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
    first line also tells the log's time zone.

    Args:
        log: The log.
        path: The file.
        scope: Which events.
        progress: Told how far the reading is.
    """
    finder = log.commit_finder()
    limit = log.limit_of(scope)
    retractions = log.retractions(limit)
    written, zone = WrittenLines(), {"timezone": log.info.timezone}
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for batch in _batches(log, scope.at_ns, limit, progress, finder.look_at):
            hidden = retractions.hidden(batch).tolist()
            for recorded, retracted in zip(batch, hidden, strict=True):
                commit = finder.commit_at(recorded.number)
                file.write(_line(zone | line_to_json(recorded, commit, retracted=retracted)))
                zone = {}
                written.events += 1
                written.retracted += retracted
    return written


def _batches(
    log: DoorLog,
    at_ns: int | None,
    limit: int | None,
    progress: Progress | None,
    on_page: OnPage,
) -> Iterator[EventBatch]:
    if limit is not None and limit < 0:
        return
    window = Window.up_to(at_ns=None, event=limit)
    for batch in log.batches_in(window, progress=progress, on_page=on_page):
        chosen = batch if at_ns is None else happened_by(batch, at_ns)
        if len(chosen):
            yield chosen


def _line(shown: dict[str, Any]) -> str:
    return json.dumps(shown, ensure_ascii=False, allow_nan=False) + "\n"
