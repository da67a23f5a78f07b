"""Several robots' logs of one building as one door map: a view, which answers as any log does.

    building = sl.join(["tug1", "tug2"], frames={"tug2": (12.5, -3.0, 1.5708)})
    building.replay(at="2026-03-01T12:00").doors

The view is a log that the ordinary writer makes in a folder; so each question means what it always
means. It is made again only where a log has grown.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import weakref
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import replace
from pathlib import Path, PurePath

from semmap_log.core.io.object_cache import VARIABLE
from semmap_log.core.io.url_path import place_of
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.errors import LogAccessError, LogError
from semmap_log.fleet.join import joined_logs
from semmap_log.fleet.join.door_plan import plan_doors
from semmap_log.fleet.join.join_building import build_join
from semmap_log.log import DoorLog
from semmap_log.log.transport import LogFolder

VIEW_VERSION = 2
"""Version of the translation: another version's views are not used."""
FOLDER = "joined"
"""In a cache: where views lie."""
TEMPORARY = "semmap-log-joined-"
"""Prefix of the folder of a view that is not kept."""
LOGS_NAME = ".logs"
"""In a view: the file that lists the ids of its logs, one a line."""

Frames = Mapping[str, tuple[float, float, float]]


class JoinedView:
    """The folder of a view; unless it is in a cache, it is removed with this object."""

    def __init__(self, joined: joined_logs.JoinedLogs, cache: Path | None) -> None:
        """Find the view of some logs, or make it.

        Raises:
            LogError: A log cannot be read.
            LogAccessError: The view cannot be written.
        """
        seed = seed_of(joined)
        self._temporary = None
        if cache is None:
            self._temporary = tempfile.TemporaryDirectory(prefix=TEMPORARY)
            self.path = Path(self._temporary.name) / "view"
            build_join(joined, plan_doors(joined), self.path, seed)
            _write_log_ids(joined, self.path)
            return
        self.path = cache / FOLDER / seed.hex()[:32]
        if not self.path.is_dir():
            _build_and_rename(joined, self.path, seed)


def _build_and_rename(joined: joined_logs.JoinedLogs, path: Path, seed: bytes) -> None:
    """Make a view under another name, then rename it; another process may have been quicker."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=path.parent) as beside:
            made = Path(beside) / "view"
            build_join(joined, plan_doors(joined), made, seed)
            _write_log_ids(joined, made)
            with suppress(FileExistsError):
                made.rename(path)
    except LogError:
        raise
    except OSError as error:
        if not path.is_dir():
            raise LogAccessError(f"{path}: no view can be there: {error.strerror}.") from error


def seed_of(joined: joined_logs.JoinedLogs) -> bytes:
    """Return the hash that identifies a view: of the definition and each log's head."""
    told = [
        VIEW_VERSION,
        joined.reference.name,
        [
            [log.name, log.log_id, log.last_event, log.head.hex(), _listed(log.frame)]
            for log in joined.logs
        ],
        sorted([row.log, row.door, row.building_door] for row in joined.definition.doors),
    ]
    return hashlib.sha256(json.dumps(told).encode()).digest()


def _listed(frame: RigidTransform | None) -> list[float] | None:
    return None if frame is None else frame.as_list()


def _write_log_ids(joined: joined_logs.JoinedLogs, view: Path) -> None:
    """Write into a view which logs it is of."""
    (view / LOGS_NAME).write_text("\n".join(log.log_id for log in joined.logs), "ascii")


def views_of(log_ids: AbstractSet[str], cache: Path) -> list[Path]:
    """Return the views in a cache that may be of one of these logs."""
    try:
        return [view for view in sorted((cache / FOLDER).iterdir()) if is_view_of(log_ids, view)]
    except OSError:
        return []


def is_view_of(log_ids: AbstractSet[str], view: Path) -> bool:
    """Return whether a view may be of one of these logs; an unfinished view may be of any."""
    try:
        return not log_ids.isdisjoint((view / LOGS_NAME).read_text("ascii").split())
    except (OSError, ValueError):
        return True


_views: weakref.WeakValueDictionary[tuple[bytes, Path | None], JoinedView] = (
    weakref.WeakValueDictionary()
)
"""The views that are being read: requested twice, a view is made once."""


def view_of(joined: joined_logs.JoinedLogs, cache: Path | None = None) -> JoinedView:
    """Return the view of some logs, made now or before.

    Args:
        joined: The logs.
        cache: A folder to keep it in; None: that which SEMMAP_LOG_CACHE names, else none.
    """
    named = os.environ.get(VARIABLE, "")
    where = cache or (Path(named).absolute() if named else None)
    key = seed_of(joined), where
    found = _views.get(key)
    if found is None or not found.path.is_dir():
        found = _views[key] = JoinedView(joined, where)
    return found


def view_of_file(path: Path) -> JoinedView:
    """Return the view of a definition, as its logs are now."""
    return view_of(joined_logs.open_joined(joined_logs.read_definition(path)))


def join(
    logs: Iterable[str | PurePath] | Mapping[str, str | PurePath],
    *,
    doors: str | Path | Iterable[tuple[str, str, str]] | None = None,
    frames: Frames | None = None,
    reference: str | None = None,
    cache: str | Path | None = None,
) -> DoorLog:
    """Return several robots' logs of one building as one log to read.

    Doors of the same level and name, unique in each log, are one, as are those of the table.
    All others are called `robot/door`. For each field the latest event counts, from whichever log.

    Args:
        logs: Paths or URLs; or name -> path or URL. Their order means nothing.
        doors: A CSV file with the columns log, door, building door; or such rows.
        frames: Log -> (dx, dy, theta), metres and radians: where its map lies in the building's.
            Without a frame a log's poses do not count.
        reference: The log whose map is the building's; default: the one that began first.
        cache: A folder to keep the view in; default: SEMMAP_LOG_CACHE, else it is made each time.

    Raises:
        LogError: A log cannot be read, or two are forks of one.
        FormatError: The table names a missing log or door, or a door twice.
    """
    joined = joined_logs.open_joined(
        defined(logs, doors=doors, frames=frames or {}, reference=reference or "")
    )
    view = view_of(joined, None if cache is None else Path(cache).absolute())
    return DoorLog(LogFolder(view.path, made=view))


def defined(
    logs: Iterable[str | PurePath] | Mapping[str, str | PurePath],
    *,
    doors: str | Path | Iterable[tuple[str, str, str]] | None = None,
    frames: Frames,
    reference: str = "",
) -> joined_logs.JoinDefinition:
    """Return a definition with all names and ids, as for `join`."""
    named = logs.items() if isinstance(logs, Mapping) else (("", log) for log in logs)
    places = tuple(joined_logs.JoinedPlace(_absolute(place_of(log)), name) for name, log in named)
    rows, rows_from = _rows(doors)
    opened = joined_logs.open_joined(joined_logs.JoinDefinition(places, rows, reference, rows_from))
    told = {
        joined_logs.log_called(name, opened.logs).name: RigidTransform(*at)
        for name, at in frames.items()
    }
    found = tuple(
        replace(one, frame=told.get(one.name, _own_frame(one, opened)))
        for one in opened.definition.logs
    )
    return replace(opened.definition, logs=found, doors_from=rows_from)


def _own_frame(
    one: joined_logs.JoinedPlace, opened: joined_logs.JoinedLogs
) -> RigidTransform | None:
    is_reference = one.name == opened.reference.name
    return None if is_reference and one.frame == RigidTransform() else one.frame


def _absolute(place: PurePath) -> PurePath:
    return place.absolute() if isinstance(place, Path) else place


def _rows(
    doors: str | Path | Iterable[tuple[str, str, str]] | None,
) -> tuple[tuple[joined_logs.DoorRow, ...], str]:
    if doors is None:
        return (), ""
    if isinstance(doors, (str, Path)):
        return tuple(joined_logs.read_door_rows(Path(doors))), str(doors)
    return tuple(joined_logs.DoorRow(*row) for row in doors), ""
