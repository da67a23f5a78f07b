"""A log verified, copied and recovered, its keyframes compared with what the replay says."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path, PurePath

from semmap_log.core.io.clock import Clock
from semmap_log.core.texts import command_line
from semmap_log.errors import LogError
from semmap_log.log.replay.keyframe_check import ReplayKeyframeCheck
from semmap_log.log.replay.read_model.indexing import index_problems
from semmap_log.log.replay.written_state import WrittenState
from semmap_log.store import salvage, verification
from semmap_log.store.copying import Copied, copy_log
from semmap_log.store.salvage import Recovered, RecoveryPlan, StateParts
from semmap_log.store.verification import Progress, Verification
from semmap_log.store.verification.file_place import FilePlace
from semmap_log.store.verification.findings import Finding, Severity

_PARTS = StateParts(ReplayKeyframeCheck, WrittenState)


def verify(
    path: PurePath | FilePlace,
    head: bytes | None = None,
    progress: Progress | None = None,
    *,
    ends: Collection[int] = (),
) -> Verification:
    """Read all of a log, or one segment of it, and return what is wrong; as `verification.verify`.

    Args:
        path: The log's folder, one .mcap file, a zip file or a URL of it; or another place.
        head: Hash of a commit that the log must hold, kept elsewhere.
        progress: Told how many bytes are read.
        ends: Event numbers: whether a commit ends before each of them, and with which hash.

    Raises:
        LogAccessError: The file system does not let us read it.
        LogError: It is of another format version.
    """
    found = verification.verify(path, ReplayKeyframeCheck, head, progress, ends=ends)
    return replace(found, findings=(*found.findings, *_index_findings(path)))


def copy(
    log: Path, target: Path, *, full: bool = False, progress: Progress | None = None
) -> Copied:
    """Copy a log, or bring a copy of it up to date; as `copying.copy_log`.

    Args:
        log: Its folder, or a zip file with it; it may be written meanwhile.
        target: A folder that is not there yet, or is empty, or an earlier copy of the same log.
        full: Read and verify what is there already, too; what is damaged there is copied again.
        progress: Told how many bytes were copied and verified.

    Raises:
        LogExistsError: Something else lies at the target.
        LogError: Another log lies there, or one that went on by itself; or there is no log.
        LogLockedError: Somebody writes to the copy.
        CorruptLogError: The log is damaged; the copy is as it was.
        OutputError: The copy cannot be written; it holds what it held, or some segments more.
    """
    return copy_log(log, target, ReplayKeyframeCheck, full=full, progress=progress)


def _index_findings(path: PurePath | FilePlace) -> list[Finding]:
    """Return which tables of the read model are not used: nothing of the log is lost with them."""
    if not isinstance(path, Path):
        return []
    try:
        problems = index_problems(path)
    except LogError:  # which verify has told of
        return []
    do = f"`{command_line('index', path)}` makes it anew."
    return [
        Finding("index", Severity.WARNING, file, None, None, f"not used: {said} {do}")
        for file, said in problems
    ]


def plan_recovery(path: Path, progress: Progress | None = None) -> RecoveryPlan:
    """Read a log and return what a recovery would save and lose; as `salvage.plan_recovery`.

    Raises:
        NewerLogError: It is damaged, and holds what only a later version can take over.
        LogError: It cannot be read, or is no log.
    """
    return salvage.plan_recovery(path, ReplayKeyframeCheck, progress)


def recover(
    log: Path,
    *,
    progress: Progress | None = None,
    clock: Clock | None = None,
    entropy: Callable[[int], bytes] = os.urandom,
) -> Recovered:
    """Put what is whole of a damaged log in its place; as `salvage.recover`.

    Raises:
        LogLockedError: Somebody is writing.
        LogAccessError: The file system does not let us.
        LogError: There is no log, or what was made of it is not good; nothing is changed then.
    """
    return salvage.recover(log, _PARTS, progress=progress, clock=clock, entropy=entropy)


def recover_into(
    log: Path,
    target: Path,
    *,
    progress: Progress | None = None,
    clock: Clock | None = None,
    entropy: Callable[[int], bytes] = os.urandom,
) -> Recovered:
    """Make a new log of what is whole of a damaged one, which stays; as `salvage.recover_into`.

    Raises:
        LogExistsError: There is something at the target.
        LogAccessError: The file system does not let us.
        LogError: There is no log, or what was made of it is not good; nothing is changed then.
    """
    return salvage.recover_into(
        log, target, _PARTS, progress=progress, clock=clock, entropy=entropy
    )
