"""Which `SegmentStore` a place is: a folder, a zip, or a URL."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.local_segments import LocalSegments
from semmap_log.store.reading.segment_store import SegmentStore

if TYPE_CHECKING:
    from semmap_log.core.io.object_cache import ObjectCache


def store_at(
    place: LogFolder | PurePath | SegmentStore,
    *,
    cache: ObjectCache | None = None,
    rest_at: UrlPath | None = None,
) -> SegmentStore:
    """Return where the segments of a log are read.

    Args:
        place: A folder, a zip, a URL, or what is one already.
        rest_at: Where segments are read that were removed from a folder.
        cache: Keeps on a disk what is fetched of a URL; default: as the environment says.

    Raises:
        NotALogError: It is a URL that leads to no log.
        LogError: There is not one log in a zip file, or it cannot be unpacked.
        MissingExtraError: A URL needs a package that is not installed.
    """
    if isinstance(place, LogFolder):
        return LocalSegments(place)
    if not isinstance(place, PurePath):
        return place
    found = place_of(place)
    if isinstance(found, UrlPath):
        from semmap_log.core.io.object_store import ObjectStore
        from semmap_log.store.reading.object_segments import ObjectSegments

        return ObjectSegments(ObjectStore(found), cache=cache)
    return LocalSegments(LogFolder(found), rest_at=rest_at)
