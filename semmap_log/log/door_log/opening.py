"""How a log is made, and opened for writing."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol, TypedDict

from semmap_log.core.io.clock import Clock, SystemClock
from semmap_log.core.io.url_path import local_path
from semmap_log.core.model.commits import Durability, check_text
from semmap_log.core.model.keywords import check_keywords
from semmap_log.core.model.moments import MOST_HOLDS, USUAL_HOLDS, machine_zone, zone
from semmap_log.errors import InvalidEventError
from semmap_log.log.door_log.door_log_writer import DoorLogWriter
from semmap_log.log.replay.read_model.indexing import keep_up
from semmap_log.log.replay.written_state import WrittenState
from semmap_log.store.commit_records import Entropy
from semmap_log.store.header import LogInfo
from semmap_log.store.writing.durability import DurabilityPolicy
from semmap_log.store.writing.writer import Environment, LogWriter
from semmap_log.store.writing.writer_opening import OpenedLog, create_log, open_for_append

if TYPE_CHECKING:
    from typing_extensions import Unpack


class FollowsWriter(Protocol):
    """Signs what a writer appends: `semmap_log.log.signing.background_signer.BackgroundSigner`."""

    def follow(self, writer: LogWriter) -> None:
        """Take the writer, before anything is appended."""


class WritingOptions(TypedDict, total=False):
    """The keywords of `append`, which says what each is; `create` takes them, too."""

    durability: Durability | str
    batch_events: int
    batch_s: float
    compact: bool
    clock: Clock | None
    entropy: Entropy
    signer: FollowsWriter | None


_USUAL: Final[WritingOptions] = {
    "durability": Durability.EVENT,
    "batch_events": DurabilityPolicy.batch_events,
    "batch_s": DurabilityPolicy.batch_s,
    "compact": True,
    "clock": None,
    "entropy": os.urandom,
    "signer": None,
}


def create(
    path: str | Path,
    *,
    tz: str | None = None,
    building: str = "",
    robot: str = "",
    holds: int = USUAL_HOLDS,
    **writing: Unpack[WritingOptions],
) -> DoorLogWriter:
    """Make a new log and open it for writing.

    Args:
        path: A folder that does not exist, or is empty.
        tz: IANA zone in which times without an offset are read and shown; default: the machine's.
        building: Its name.
        robot: The robot's name.
        holds: A sighting of a door holds for this many median gaps between looks at it; then the
            door counts as not seen. 0: until the next report, as of sensors that report each
            change.
        **writing: The keywords of `append`: `durability` and the others.

    Raises:
        LogExistsError: There is something there already.
        MomentError: No such zone.
        InvalidEventError: No such durability, or `holds` is out of range.
    """
    environment = _environment(create, writing)
    timezone = machine_zone() if tz is None else tz
    zone(timezone)
    check_text("building", building)
    check_text("robot", robot)
    if not 0 <= holds <= MOST_HOLDS:
        raise InvalidEventError("holds", f"0 to {MOST_HOLDS} gaps between looks", holds)
    info = LogInfo(environment.entropy(16).hex(), timezone, building, robot, holds)
    return _followed(create_log(local_path(path), info, WrittenState, environment), writing)


def append(path: str | Path, **writing: Unpack[WritingOptions]) -> DoorLogWriter:
    """Open a log for writing; what a crash left unfinished is put in order first.

    Args:
        path: The log's folder.
        durability: What is promised of an append when it returns: `event` (it survives a power
            cut), `batch` (soon it does), `flush` (the end of the process) or `none`.
        batch_events: `batch`: so many events at most are not yet synced.
        batch_s: `batch`: after so many seconds at most they are.
        compact: Put full segments into large compressed chunks, in a background thread.
        clock: Where times come from; default: the machine.
        entropy: Where ids come from; seed it to get the same bytes again.
        signer: Signs the log's end from time to time: a `BackgroundSigner`; default: nobody does.

    Raises:
        NotALogError: There is none at that path.
        LogLockedError: Another process is writing.
        LogAccessError: It is on a read-only place.
        InvalidEventError: No such durability.
    """
    opened = open_for_append(local_path(path), WrittenState, _environment(append, writing))
    return _followed(opened, writing)


def _followed(opened: OpenedLog[WrittenState], writing: WritingOptions) -> DoorLogWriter:
    signer = writing.get("signer")
    if signer is not None:
        signer.follow(opened.writer)
    return DoorLogWriter(opened)


def _environment(call: Callable[..., object], writing: WritingOptions) -> Environment:
    check_keywords(call, writing, WritingOptions)
    given = _USUAL | writing
    policy = DurabilityPolicy.of(given["durability"], given["batch_events"], given["batch_s"])
    clock = given["clock"] or SystemClock()
    return Environment(policy, clock, given["entropy"], given["compact"], keep_up)
