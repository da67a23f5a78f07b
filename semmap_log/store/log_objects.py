"""Which objects below a URL are a log's."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.store.bag_metadata import listed_names
from semmap_log.store.form import (
    BAG_METADATA_NAME,
    MANIFEST_NAME,
    MOST_LIST_BYTES,
    OLD_MARK_NAME,
)
from semmap_log.store.manifest import Manifest, manifest_in


def log_objects(store: ObjectStore) -> list[ObjectStatus]:
    """Return what lies right below a URL, by name.

    A web server that lists nothing is asked for what the log's metadata.yaml names: the closed
    segments, which tell how far it reached. What a mark is called, only a list tells; but for those
    of older versions.

    Raises:
        LogAccessError: The store does not let us.
    """
    listed = store.list()
    if listed or not store.is_web_server:
        return listed
    return _asked_for(store, (*listed_names(metadata_text(store)), OLD_MARK_NAME))


def objects_named(store: ObjectStore, names: Sequence[str]) -> list[ObjectStatus]:
    """Return those of some objects that are there, by name.

    Raises:
        LogAccessError: The store does not let us.
    """
    if store.is_web_server:
        return _asked_for(store, names)
    wanted = set(names)
    return [status for status in store.list() if status.name in wanted]


def _asked_for(store: ObjectStore, names: Sequence[str]) -> list[ObjectStatus]:
    found = []
    for name in names:
        with suppress(FileNotFoundError):
            found.append(store.status(name))
    return sorted(found, key=lambda status: status.name)


@dataclass(frozen=True, slots=True)
class KeptManifest:
    """A manifest, and what tells it from the next one."""

    manifest: Manifest
    e_tag: str
    modified_ns: int
    """When it was put, by the store's clock, nanoseconds UTC."""


def read_manifest(store: ObjectStore, before: KeptManifest | None = None) -> KeptManifest | None:
    """Return a log's manifest as it is now; None: there is none.

    Args:
        store: Where it lies.
        before: As it was; it is not fetched again while it is the same.

    Raises:
        CorruptLogError: It is damaged.
        LogAccessError: The store does not let us.
    """
    try:
        e_tag = "" if before is None else before.e_tag
        got = store.whole(MANIFEST_NAME, e_tag, most_bytes=MOST_LIST_BYTES)
    except FileNotFoundError:
        return None
    if got is None:
        return before
    data, status = got
    manifest = manifest_in(data, store.url / MANIFEST_NAME)
    return KeptManifest(manifest, status.e_tag, status.modified_ns)


def metadata_text(store: ObjectStore) -> str:
    """Return the text of metadata.yaml; nothing where there is none.

    Raises:
        CorruptLogError: It is too long.
        LogAccessError: The store does not let us.
    """
    with suppress(FileNotFoundError):
        got = store.whole(BAG_METADATA_NAME, most_bytes=MOST_LIST_BYTES)
        return "" if got is None else got[0].decode("utf-8", "replace")
    return ""
