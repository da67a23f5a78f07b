"""The file of a join, `X.join.json`: which logs, where each map lies, which doors are one."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

from semmap_log.core.io.disk import replace_file
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.errors import LogError, NotALogError
from semmap_log.fleet.join.door_matches import DoorRow

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
    """The log whose frame is the building's; empty: that which began first."""
    doors_from: str = field(default="", compare=False)
    """The file with the table of doors, for messages."""


def read_definition(path: Path) -> JoinDefinition:
    """Return what a file says; paths in it are relative to its folder.

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
        LogError: It is not called as one.
        OutputError: It cannot be written.
    """
    if not path.name.endswith(SUFFIX) or path.name == SUFFIX:
        raise LogError(f"{path}: expected a name that ends with {SUFFIX}.")
    text = json.dumps(to_json(definition, path.absolute().parent), indent=2, ensure_ascii=False)
    replace_file(path, f"{text}\n".encode(errors="backslashreplace"))  # JSON's escapes, too


def to_json(definition: JoinDefinition, folder: Path) -> dict[str, Any]:
    """Return what the file says that lies in a folder."""
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
