"""A log under other names, for as long as it is needed: every export reads it as any other."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from semmap_log.batches.event_batch import RecordedEvent
from semmap_log.domain.commits import Commit
from semmap_log.door_log.door_log import DoorLog
from semmap_log.door_log.opening import create
from semmap_log.door_log.read_log import read
from semmap_log.errors import CommandError
from semmap_log.exporting.json_lines import write_event_lines
from semmap_log.importing.importing import import_file
from semmap_log.io.progress import Progress
from semmap_log.pseudonyms.pseudonyms import Pseudonyms
from semmap_log.replay.replay import Scope


@contextmanager
def pseudonymous(
    log: DoorLog,
    scope: Scope = Scope(),
    *,
    with_tracks: bool = False,
    progress: Progress | None = None,
) -> Iterator[tuple[DoorLog, Pseudonyms]]:
    """Hand out a copy of a log without names; it goes when it was used.

    Events that are left out have no number in it, so that those behind have others than in the
    log. Its times are those of the log.

    Args:
        log: The log.
        scope: Which events there are in the copy.
        with_tracks: Tell where the robot was.
        progress: Told how far the reading is.

    Raises:
        OutputError: There is no room for it.
        CommandError: The log has a horizon: how doors were there is in no event.
    """
    if log.horizon():
        raise CommandError(
            f"{log.path}: its history begins at event {log.horizon()}, and how doors were there is "
            "in no event: no pseudonymous copy can be made of it."
        )
    names = Pseudonyms(with_tracks=with_tracks)

    def retell(event: RecordedEvent, commit: Commit) -> tuple[RecordedEvent, Commit] | None:
        told = names.event(event.event)
        return None if told is None else (replace(event, event=told), names.commit(commit))

    with TemporaryDirectory(prefix="semmap-log-") as folder:
        lines, path = Path(folder, "events.jsonl"), Path(folder, "log")
        write_event_lines(log, lines, scope, retell=retell, progress=progress)
        with create(path, tz=log.info.timezone, durability="none") as copy:
            import_file(copy, lines)
        lines.unlink()
        yield read(path), names
