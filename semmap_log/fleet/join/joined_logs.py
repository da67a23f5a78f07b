"""The logs of a join, open: each once, under a name of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.core.texts import command_line
from semmap_log.errors import LogError, NotALogError
from semmap_log.fleet.join.join_definition import (
    SUFFIX,
    JoinDefinition,
    JoinedPlace,
    read_definition,
)
from semmap_log.log.door_log.robot_names import BEHIND_ROBOT, BETWEEN_ROBOTS
from semmap_log.store.reading.reader import LogReader

MAX_NS = 2**63 - 1


@dataclass(frozen=True, slots=True)
class JoinedLog:
    """A log of a join, as it was when it was opened: up to its last commit."""

    name: str
    opened: LogReader
    place: PurePath
    frame: RigidTransform | None
    """To the building's frame; None: not known, so that its geometry does not count."""
    last_event: int
    head: bytes
    began_ns: int

    @property
    def log_id(self) -> str:
        """The id of the log."""
        return self.opened.info.log_id


@dataclass(frozen=True, slots=True)
class JoinedLogs:
    """The logs of a join, by their ids, so that the order in which they were given is nothing."""

    logs: tuple[JoinedLog, ...]
    reference: JoinedLog
    """The log whose frame is the building's."""
    definition: JoinDefinition
    """As it was meant, with all names and ids."""


def open_joined(definition: JoinDefinition) -> JoinedLogs:
    """Open what a definition names; a join among the logs stands for its own.

    Raises:
        LogError: There is none, one is not what it was, or two are forks of one log.
    """
    whole = _flat(definition, ())
    if not whole.logs:
        raise NotALogError("a join wants at least one log.")
    opened = _without_copies([_opened(place) for place in whole.logs])
    named = _named(opened)
    reference = _reference(named, whole.reference)
    logs = tuple(
        JoinedLog(o.name, o.opened, o.place, o.frame or RigidTransform(), *_end(o))
        if o is reference
        else o
        for o in named
    )
    _check_frames(logs)
    places = tuple(JoinedPlace(o.place, o.name, o.log_id, o.frame) for o in logs)
    told = JoinDefinition(places, whole.doors, reference.name, whole.doors_from)
    return JoinedLogs(logs, logs[named.index(reference)], told)


def _end(log: JoinedLog) -> tuple[int, bytes, int]:
    return log.last_event, log.head, log.began_ns


def _check_frames(logs: Sequence[JoinedLog]) -> None:
    if len({log.name for log in logs}) < len(logs):
        raise LogError("two logs of a join have one name; name them apart in the definition.")


def flat_definition(path: Path) -> JoinDefinition:
    """Return what a file says, with the logs of the joins among its logs in their place.

    Raises:
        LogError: It is no definition, names no log, or is a part of itself.
    """
    whole = _flat(read_definition(path), (path,))
    if not whole.logs:
        raise NotALogError(f"{path}: a join wants at least one log.")
    return whole


def _flat(definition: JoinDefinition, inside: tuple[PurePath, ...]) -> JoinDefinition:
    """Return a definition without joins among its logs."""
    logs: list[JoinedPlace] = []
    doors, reference = list(definition.doors), definition.reference
    for one in definition.logs:
        if not str(one.place).endswith(SUFFIX):
            logs.append(one)
            continue
        if one.place in inside:
            raise LogError(f"{one.place}: a join cannot be a part of itself.")
        if one.frame is not None:
            raise LogError(f"{one.place}: a join has no frame of its own; give one to its logs.")
        inner = _flat(read_definition(Path(one.place)), (*inside, one.place))
        logs += inner.logs
        doors += inner.doors
        reference = reference or inner.reference
    return JoinDefinition(tuple(logs), tuple(doors), reference, definition.doors_from)


def _opened(place: JoinedPlace) -> JoinedLog:
    reader = LogReader(place.place)
    if place.log_id and reader.info.log_id != place.log_id:
        raise LogError(
            f"{place.place}: another log lies here now (expected the id {place.log_id}, got "
            f"{reader.info.log_id}); join anew."
        )
    last = reader.last_commit()
    first = reader.find_commit(0)
    return JoinedLog(
        place.name,
        reader,
        place.place,
        place.frame,
        -1 if last is None else last.last_event,
        b"" if last is None else last.hash,
        MAX_NS if first is None else first.recorded_ns,
    )


def _without_copies(opened: Iterable[JoinedLog]) -> list[JoinedLog]:
    """Return each log once: of copies the longest.

    Raises:
        LogError: Two have the same id, and neither goes on where the other ends.
    """
    kept: dict[str, JoinedLog] = {}
    for log in sorted(opened, key=lambda o: (o.log_id, -o.last_event, not o.name, str(o.place))):
        longer = kept.setdefault(log.log_id, log)
        if longer is log:
            continue
        there = longer.opened.find_commit(log.last_event) if log.last_event >= 0 else None
        if log.last_event >= 0 and (there is None or there.hash != log.head):
            raise LogError(
                f"{log.place} and {longer.place}: forks of one log (id {log.log_id}): they have "
                f"other commits up to event {log.last_event}. Join one of them, and find out why: "
                f"{command_line('verify', longer.place, '--head', log.head.hex())}"
            )
        if log.frame is not None and longer.frame not in (None, log.frame):
            raise LogError(f"{log.place}: a copy of {longer.place}, in another frame.")
        if longer.frame is None and log.frame is not None:
            kept[log.log_id] = JoinedLog(
                longer.name, longer.opened, longer.place, log.frame, *_end(longer)
            )
    return list(kept.values())


def _named(logs: Sequence[JoinedLog]) -> list[JoinedLog]:
    """Return the logs with names: as given, else the robot's, else the folder's, else the id."""
    names = [log.name for log in logs]
    for tried in (_robot, _folder, lambda log: log.log_id[:8]):
        wanted = [name or _plain(tried(log)) for name, log in zip(names, logs, strict=True)]
        bearers = Counter(wanted)
        names = [
            name or (one if bearers[one] == 1 else "")
            for name, one in zip(names, wanted, strict=True)
        ]
    return [
        JoinedLog(name or log.log_id, log.opened, log.place, log.frame, *_end(log))
        for name, log in zip(names, logs, strict=True)
    ]


def _robot(log: JoinedLog) -> str:
    return log.opened.info.robot


def _folder(log: JoinedLog) -> str:
    return log.place.stem if log.place.suffix == ".zip" else log.place.name


def _plain(name: str) -> str:
    """Return a name that can stand before a source, and beside others."""
    return name.replace(BEHIND_ROBOT, "-").replace(BETWEEN_ROBOTS.strip(), "-").strip()


def _reference(logs: Sequence[JoinedLog], wanted: str) -> JoinedLog:
    """Return the log of that name; else that which began first."""
    if not wanted:
        return min(logs, key=lambda log: (log.began_ns, log.log_id))
    return log_called(wanted, logs)


def log_called(name: str, logs: Sequence[JoinedLog]) -> JoinedLog:
    """Return the log of that name, or at that place.

    Raises:
        LogError: There is none.
    """
    for log in logs:
        if name in (log.name, str(log.place), log.log_id):
            return log
    known = ", ".join(sorted(log.name for log in logs))
    raise LogError(f"no log {name!r} is joined; there are: {known}.")
