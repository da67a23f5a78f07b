"""Recovers a log: into another folder, or in its place with the damaged files kept."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from semmap_log.core.io.clock import Clock, SystemClock
from semmap_log.core.io.disk import sync_folder
from semmap_log.core.texts import counted
from semmap_log.errors import (
    CorruptLogError,
    LogAccessError,
    LogError,
    LogExistsError,
)
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import NO_HASH, RECOVERING_NAME
from semmap_log.store.header import LogInfo, SegmentHeader
from semmap_log.store.lock import WriterLock
from semmap_log.store.salvage.recovered_log import NewLog
from semmap_log.store.salvage.recovery_plan import Loss, RecoveryPlan, plan_recovery
from semmap_log.store.salvage.swap import new_folder_beside, put_away, take_place
from semmap_log.store.verification import Progress, Verifier, verify
from semmap_log.store.verification.file_place import DiskPlace
from semmap_log.store.verification.folder_files import arrange
from semmap_log.store.verification.keyframe_place import NewKeyframeCheck
from semmap_log.store.writing.keyframe_source import KeyframeSource, NewKeyframeSource
from semmap_log.store.zip_files import refuse_zip

MOST_NAMED = 20
"""Losses that the note of the new log's last commit names one by one."""

Entropy = Callable[[int], bytes]


@dataclass(frozen=True, slots=True)
class StateParts:
    """What a recovery is handed in of the state that keyframes hold."""

    new_check: NewKeyframeCheck
    """Compares the keyframes of the damaged log, and of the new one, with their events."""
    new_source: NewKeyframeSource[KeyframeSource]
    """Makes the keyframes of the new log."""


@dataclass(frozen=True, slots=True)
class Recovered:
    """What a recovery did."""

    plan: RecoveryPlan
    log: Path | None
    """The log that is whole now; None: there was nothing to do."""
    kept: Path | None
    """Where the damaged files are now."""


def recover(
    log: Path,
    parts: StateParts,
    *,
    progress: Progress | None = None,
    clock: Clock | None = None,
    entropy: Entropy = os.urandom,
) -> Recovered:
    """Put what is whole of a damaged log in its place; the old files go to `damaged-<n>` in it.

    Where numbers change, the log gets a new id: positions in the old one mean nothing in it.
    On a log without damage nothing is done.

    Args:
        log: Its folder.
        parts: Know the state.
        progress: Told how far the reading of the damaged log is.
        clock: Says when the new log was made.
        entropy: Where ids come from.

    Raises:
        LogLockedError: Somebody is writing.
        LogAccessError: The file system does not let us.
        LogError: There is no log, or what was made of it is not good; nothing is changed then.
    """
    log = log.resolve()
    _check_is_folder(log)
    old = LogFolder.held(log)
    lock = WriterLock(old)
    try:
        kept = put_away(log)
        found = plan_recovery(log, parts.new_check, progress)
        if not found.has_to_do:
            return Recovered(found, log if kept else None, kept)
        header = _header(found, entropy, is_new=not found.keeps_numbers)
        with new_folder_beside(log) as folder:
            made = LogFolder.held(folder)
            new_lock = WriterLock(made)
            try:
                new = NewLog(made, log.name, header, parts.new_source, found.trimmed)
                _write(found, new, parts.new_check, clock or SystemClock(), entropy)
                take_place(log, old)
                kept = put_away(log)
            finally:
                new_lock.release()
    except OSError as error:
        if isinstance(error, LogAccessError):
            raise
        raise LogAccessError(f"{log}: cannot be recovered: {error.strerror}.") from error
    finally:
        lock.release()
    return Recovered(found, log, kept)


def recover_into(
    log: Path,
    target: Path,
    parts: StateParts,
    *,
    progress: Progress | None = None,
    clock: Clock | None = None,
    entropy: Entropy = os.urandom,
) -> Recovered:
    """Make a new log, with an id of its own, of what is whole of a damaged one; that stays.

    Args:
        log: The damaged log's folder.
        target: That of the new one, which is not there yet, or empty.
        parts: As for `recover`.
        progress: As for `recover`.
        clock: As for `recover`.
        entropy: As for `recover`.

    Raises:
        LogExistsError: There is something at the target.
        LogAccessError: The file system does not let us.
        LogError: There is no log, or what was made of it is not good; nothing is changed then.
    """
    target = target.resolve()
    if target.exists() and not (target.is_dir() and LogFolder(target).is_empty()):
        raise LogExistsError(f"{target}: there is something here; a new log wants a new folder.")
    found = plan_recovery(log, parts.new_check, progress)
    if not found.has_to_do:
        return Recovered(found, None, None)
    try:
        with new_folder_beside(target) as folder:
            header = _header(found, entropy, is_new=True)
            made = LogFolder.held(folder)
            new = NewLog(made, target.name, header, parts.new_source, found.trimmed)
            _write(found, new, parts.new_check, clock or SystemClock(), entropy)
            (folder / RECOVERING_NAME).unlink()
            folder.rename(target)
            sync_folder(target.parent)
    except OSError as error:
        if isinstance(error, LogAccessError):
            raise
        raise LogAccessError(f"{target}: cannot be written: {error.strerror}.") from error
    return Recovered(found, target, None)


def loss_in_words(found: RecoveryPlan) -> str:
    """Return what a recovery loses, in a sentence for the log itself."""
    if not found.losses and not found.dropped:
        return "nothing was lost"
    named = [_range(loss) for loss in found.losses[:MOST_NAMED]]
    if len(found.losses) > MOST_NAMED:
        named.append(f"{len(found.losses) - MOST_NAMED} more gaps")
    words = f"lost were events {', '.join(named)}" if named else ""
    if found.dropped:
        numbers = ", ".join(str(number) for number in found.dropped[:MOST_NAMED])
        words += f"{'; ' if words else ''}retractions of lost events were dropped: {numbers}"
    return f"{words} (numbers of the damaged log)"


def _range(loss: Loss) -> str:
    if loss.last_event is None:
        return f"from {loss.first_event} on"
    if loss.first_event == loss.last_event:
        return str(loss.first_event)
    return f"{loss.first_event}..{loss.last_event}"


def _check_is_folder(log: Path) -> None:
    refuse_zip(log)
    if not log.is_dir():
        raise LogError(f"{log}: expected a log's folder.")
    if not arrange(DiskPlace(log)).segments:
        raise LogError(f"{log}: no segment of a semmap log is in this folder.")


def _header(found: RecoveryPlan, entropy: Entropy, *, is_new: bool) -> SegmentHeader:
    """Return the header of the new log's first segment, with a new id where it is another log."""
    old = found.header
    info = LogInfo(entropy(16).hex(), "UTC") if old is None else old.info
    if is_new and old is not None:
        info = replace(info, log_id=entropy(16).hex())
    first = SegmentHeader(info, number=0, first_event=0, hash_so_far=NO_HASH)
    if old is None:
        return first
    return replace(first, minor=old.minor, others=old.others, newer=old.newer)


def _write(
    found: RecoveryPlan, new: NewLog, new_check: NewKeyframeCheck, clock: Clock, entropy: Entropy
) -> None:
    """Write the new log, and verify it before anybody sees it."""
    try:
        if found.beginning is not None:
            new.begin_with(found.beginning)
        verifier = Verifier(
            found.path, new_check, on_commit=new.add, on_gone=new.add_gone, keep_parts=True
        )
        verifier.run()
        source = f"{found.path.name} ({found.verification.log_id})"
        new.finish(source, loss_in_words(found), clock, entropy)
    except BaseException:
        new.abandon()
        raise
    made = verify(new.folder.path, new_check)
    own = 2 if found.trimmed or found.beginning is not None else 1
    if made.exit_code != 0 or made.events != found.events + own:
        first = made.findings[0].text if made.findings else counted(made.events, "event")
        raise CorruptLogError(
            new.folder.path, 0, f"the new log is not good: {first}; the old one is kept"
        )
