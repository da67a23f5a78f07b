"""A log under other names, for as long as it is needed: every export reads it as any other."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from semmap_log.core.folds.renumbering import NewNumbers, renamed
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.events import Event
from semmap_log.interop.pseudonyms.pseudonyms import Pseudonyms
from semmap_log.log import DoorLog, FollowedCommit, LogInfo, RewrittenLog, Scope

ID_BYTES = 16
TOLD_EVERY = 1000
"""Commits between two words of progress."""


@contextmanager
def pseudonymous(
    log: DoorLog,
    scope: Scope = Scope(),
    *,
    with_tracks: bool = False,
    progress: Progress | None = None,
) -> Iterator[tuple[DoorLog, Pseudonyms]]:
    """Hand out a copy of a log without names; it goes when it was used.

    Events that are left out have no number in it, so that those after have others than in the
    log. Its times are those of the log, and so is its horizon.

    Args:
        log: The log.
        scope: Which events there are in the copy.
        with_tracks: Include where the robot was.
        progress: Called with how many of the events are done.

    Raises:
        LogPoisonedError: There is no room for it.
        HorizonError: The scope ends before the log's horizon.
    """
    names = Pseudonyms(with_tracks=with_tracks)
    with TemporaryDirectory(prefix="semmap-log-") as folder:
        path = Path(folder, "log")
        info = LogInfo(os.urandom(ID_BYTES).hex(), log.info.timezone, holds=log.info.holds)
        made = RewrittenLog(path, info, os.urandom, horizon_ns=log.horizon_ns())
        try:
            _rewrite_log(log, scope, names, made, progress)
            made.finish()
        finally:
            made.close()
        yield made.read(Path("the copy without names")), names


def _rewrite_log(
    log: DoorLog, scope: Scope, names: Pseudonyms, made: RewrittenLog, progress: Progress | None
) -> None:
    total = log.last_event() + 1
    numbers = NewNumbers(total)
    for place, followed in enumerate(log.kept_commits(scope)):
        first = made.place(followed.commit.recorded_ns).first_event
        events = list(_without_names(followed, names, numbers, first))
        if events:
            commit = names.commit(followed.commit)
            made.append(events, commit, note=commit.note, command_id=commit.command_id)
        if progress is not None and place % TOLD_EVERY == 0:
            progress(followed.commit.last_event, total)


def _without_names(
    followed: FollowedCommit, names: Pseudonyms, numbers: NewNumbers, first: int
) -> Iterator[Event]:
    """Yield a commit's exported events, numbered from `first` on."""
    for recorded in followed:
        event = names.event(recorded.event)
        for told in () if event is None else renamed(event, numbers.ranges):
            numbers.add(recorded.number, first)
            first += 1
            yield replace(told, happened_ns=recorded.happened_ns)
