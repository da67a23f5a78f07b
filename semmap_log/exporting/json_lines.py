"""A log's events as JSON lines, with all that `import` needs to make the same log of them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semmap_log.door_log.door_log import DoorLog
from semmap_log.formats.json.event_json import line_to_json
from semmap_log.io.progress import Progress
from semmap_log.replay.replay import Scope

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
    retractions, total = log.retractions(log.limit_of(scope)), log.last_event() + 1
    written, zone = WrittenLines(), {"timezone": log.info.timezone}
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for place, followed in enumerate(log.kept_commits(scope)):
            commit, hidden = followed.commit, retractions.hidden(followed.batch).tolist()
            for recorded, retracted in zip(followed, hidden, strict=True):
                file.write(_line(zone | line_to_json(recorded, commit, retracted=retracted)))
                zone = {}
                written.events += 1
                written.retracted += retracted
            if progress is not None and place % TOLD_EVERY == 0:
                progress(commit.last_event, total)
    return written


def _line(shown: dict[str, Any]) -> str:
    return json.dumps(shown, ensure_ascii=False, allow_nan=False) + "\n"
