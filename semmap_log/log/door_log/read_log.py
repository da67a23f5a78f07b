"""How a log is opened for reading: nothing that writes is loaded for it."""

from __future__ import annotations

from pathlib import Path, PurePath

from semmap_log.core.io.url_path import place_of
from semmap_log.errors import NotALogError
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_folder import store_at


def read(
    path: str | PurePath, *, cache: str | Path | None = None, with_url: str | None = None
) -> DoorLog:
    """Open a log for reading.

    Args:
        path: Its folder, or the URL of a folder in a store (`s3://…`,
            `gs://…`, `az://…`, `https://…`), where it is read as it lies.
        cache: A folder in which what is fetched of a URL is kept, for whoever asks again; default:
            the one that SEMMAP_LOG_CACHE names, else nothing is.
        with_url: Of a folder from which shipped segments were removed: where these are read;
            default: the URL that SEMMAP_LOG_WITH names; else what needs them is an error that says
            where they lie.

    Raises:
        NotALogError: There is none at that path.
        LogAccessError: The store, or the cache, cannot be used.
    """
    if cache is None and with_url is None:
        return DoorLog(path)
    from semmap_log.core.io.object_cache import ObjectCache

    kept = None if cache is None else ObjectCache(Path(cache))
    rest_at = None if with_url is None else place_of(with_url)
    if isinstance(rest_at, Path):
        raise NotALogError(f"{with_url}: expected a URL of a store, such as s3://bucket/logs/tug1.")
    return DoorLog(LogReader(store_at(place_of(path), cache=kept, rest_at=rest_at)))


def open_any(path: Path) -> DoorLog:
    """Open a log's folder, or a single segment of one, for a look.

    Raises:
        NotALogError: It is neither.
    """
    if path.suffix == ".mcap":
        return DoorLog(LogReader(path.parent, only=path))
    return DoorLog(path)
