"""The logs of a join, open: each once, under a name of its own.

The file of a join, `X.join.json`, defines which logs, where each map lies, and which doors are one.
A table may also say which doors of which logs are one: `--doors matches.csv`.
"""

from __future__ import annotations

import csv
import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

from semmap_log.core.folds.renumbering import AFTER_ROBOT, BETWEEN_ROBOTS
from semmap_log.core.io.disk import replace_file
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.core.texts import command_line
from semmap_log.errors import FormatError, LogError, NotALogError, OutputError
from semmap_log.log import DoorLog

MAX_NS = 2**63 - 1


@dataclass(frozen=True, slots=True)
class JoinedLog:
    """A log of a join, as it was when it was opened: up to its last commit."""

    name: str
    opened: DoorLog
    place: PurePath
    frame: RigidTransform | None
    """Transform to the building's frame; None: unknown, so that its geometry does not count."""
    last_event: int
    head: bytes
    began_ns: int

    @property
    def log_id(self) -> str:
        """The id of the log."""
        return self.opened.info.log_id

    def known_ns(self, number: int) -> int:
        """Return when the commit of an event was recorded."""
        commit = self.opened.find_commit(number)
        assert commit is not None, "the event is in the log"
        return commit.recorded_ns


@dataclass(frozen=True, slots=True)
class JoinedLogs:
    """The logs of a join, sorted by their ids, whatever order they were given in."""

    logs: tuple[JoinedLog, ...]
    reference: JoinedLog
    """The log whose frame is the building's."""
    definition: JoinDefinition
    """The complete definition, with all names and ids."""


def open_joined(definition: JoinDefinition) -> JoinedLogs:
    """Open the logs of a definition; a join among them stands for its own logs.

    Raises:
        LogError: A log is missing or is another one, or two are forks of one log.
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
    """Read a definition, with the joins among its logs replaced by their logs.

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
    log = DoorLog(place.place)
    if place.log_id and log.info.log_id != place.log_id:
        raise LogError(
            f"{place.place}: the log was replaced by another one (expected the id {place.log_id}, "
            f"got {log.info.log_id}); run `join` again."
        )
    last = log.find_commit(log.last_event())
    first = log.find_commit(0)
    return JoinedLog(
        place.name,
        log,
        place.place,
        place.frame,
        -1 if last is None else last.last_event,
        b"" if last is None else last.hash,
        MAX_NS if first is None else first.recorded_ns,
    )


def _without_copies(opened: Iterable[JoinedLog]) -> list[JoinedLog]:
    """Return each log once: the longest of copies.

    Raises:
        LogError: Two have the same id, and neither continues the other.
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
    return log.place.name


def _plain(name: str) -> str:
    """Return a name that can precede a source, and stand next to other names."""
    return name.replace(AFTER_ROBOT, "-").replace(BETWEEN_ROBOTS.strip(), "-").strip()


def _reference(logs: Sequence[JoinedLog], wanted: str) -> JoinedLog:
    """Return the log of that name; default: the one that began first."""
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


FORMAT = "semmap-log join"
VERSION = 1
SUFFIX = ".join.json"
_MOST_BYTES = 2**24


@dataclass(frozen=True, slots=True)
class JoinedPlace:
    """A log of a join, as its definition names it."""

    place: PurePath
    name: str = ""
    """Empty: the robot's, or the folder's."""
    log_id: str = ""
    """Empty: not known."""
    frame: RigidTransform | None = None


@dataclass(frozen=True, slots=True)
class JoinDefinition:
    """What is joined, and how."""

    logs: tuple[JoinedPlace, ...]
    doors: tuple[DoorRow, ...] = ()
    reference: str = ""
    """The log whose frame is the building's; empty: the one that began first."""
    doors_from: str = field(default="", compare=False)
    """The file with the table of doors, for messages."""


def read_definition(path: Path) -> JoinDefinition:
    """Read a definition; paths in it are relative to its folder.

    Raises:
        NotALogError: It is none, or of a later version.
    """
    try:
        if (size := path.stat().st_size) > _MOST_BYTES:
            raise NotALogError(f"{path}: expected at most {_MOST_BYTES:,} bytes, got {size:,}.")
        said = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(said, dict) or said.get("format") != FORMAT:
            raise NotALogError(f'{path}: expected "format": "{FORMAT}", got another file.')
        if said.get("version") != VERSION:
            raise NotALogError(
                f"{path}: version {said.get('version')!r} of a join; this program reads {VERSION}: "
                "install a newer semmap-log."
            )
        return _definition(path, said)
    except OSError as error:
        raise NotALogError(f"{path}: cannot be read: {error.strerror}.") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise NotALogError(f"{path}: no definition of a join: {error!r}.") from None


def _definition(path: Path, said: Mapping[str, Any]) -> JoinDefinition:
    logs = tuple(_log(path.parent, one) for one in said["logs"])
    doors = tuple(
        DoorRow(one["log"], one["door"], one["building_door"]) for one in said.get("doors", ())
    )
    return JoinDefinition(logs, doors, said.get("reference", ""), str(path))


def _log(folder: Path, said: Mapping[str, Any]) -> JoinedPlace:
    place = place_of(said["log"])
    frame = said.get("frame")
    return JoinedPlace(
        place if isinstance(place, UrlPath) else Path(os.path.normpath(folder / place)),
        str(said.get("name", "")),
        str(said.get("log_id", "")),
        None if frame is None else RigidTransform(*map(float, frame)),
    )


def write_definition(path: Path, definition: JoinDefinition) -> None:
    """Write a definition.

    Raises:
        LogError: The file's name is not that of a join.
        OutputError: It cannot be written.
    """
    if not path.name.endswith(SUFFIX) or path.name == SUFFIX:
        raise LogError(f"{path}: expected a name that ends with {SUFFIX}.")
    text = json.dumps(to_json(definition, path.absolute().parent), indent=2, ensure_ascii=False)
    replace_file(path, f"{text}\n".encode(errors="backslashreplace"))  # JSON's escapes, too


def to_json(definition: JoinDefinition, folder: Path) -> dict[str, Any]:
    """Read the definition in a folder."""
    said: dict[str, Any] = {"format": FORMAT, "version": VERSION}
    if definition.reference:
        said["reference"] = definition.reference
    said["logs"] = [_log_to_json(one, folder) for one in definition.logs]
    said["doors"] = [
        {"log": row.log, "door": row.door, "building_door": row.building_door}
        for row in definition.doors
    ]
    return said


def _log_to_json(one: JoinedPlace, folder: Path) -> dict[str, Any]:
    place = one.place
    text = str(place) if isinstance(place, UrlPath) else os.path.relpath(place, folder)
    said: dict[str, Any] = {"name": one.name, "log": text, "log_id": one.log_id}
    if one.frame is not None:
        said["frame"] = one.frame.as_list()
    return said


COLUMNS = ("log", "door", "building door")


@dataclass(frozen=True, slots=True)
class DoorRow:
    """A door of a log, and its name in the building."""

    log: str
    """The log's name in the join."""
    door: str
    """Its id, name, or level/name in its own log."""
    building_door: str
    line: int = 0
    """Line of the file; 0: from elsewhere."""


def read_door_rows(path: Path) -> list[DoorRow]:
    """Return the rows of a table.

    Raises:
        FormatError: It cannot be read, lacks a column, or has a cell that is empty.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file, strict=True)
            missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                expected = f"expected the columns {', '.join(COLUMNS)}"
                raise FormatError(path, [(1, f"{expected}; {', '.join(missing)} is not there")])
            return [_row(path, reader.line_num, cells) for cells in reader]
    except (OSError, csv.Error, UnicodeDecodeError) as error:
        said = error.strerror if isinstance(error, OSError) else str(error)
        raise FormatError(path, f"cannot be read: {said}") from None


def _row(path: Path, line: int, cells: dict[str, str | None]) -> DoorRow:
    log, door, building_door = ((cells[name] or "").strip() for name in COLUMNS)
    if not (log and door and building_door):
        got = {name: cells[name] for name in COLUMNS}
        raise FormatError(path, [(line, f"expected a log, a door and a building door, got {got}")])
    return DoorRow(log, door, building_door, line)


def write_door_rows(path: Path, rows: Iterable[DoorRow]) -> None:
    """Write a table.

    Raises:
        OutputError: It cannot be written, or something is there already.
    """
    try:
        with path.open("x", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(_cells(rows))
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}.") from error


def _cells(rows: Iterable[DoorRow]) -> Iterator[tuple[str, ...]]:
    yield COLUMNS
    for row in rows:
        yield row.log, row.door, row.building_door
