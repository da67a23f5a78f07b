"""Superseded segments removed from a store, days after the manifest that named them last.

A segment that was continued, or compacted, has a successor in the manifest; its old object stays,
since somebody may be reading by the old manifest. What is removed here, a manifest has dropped,
and the store's clock says how long ago. An object that was put and that no manifest has named yet
is on nobody's list: it stays.

Two things could name an object again while it is being removed: another copy of the log, which
still has the old segment, and the same copy that was put back. So a new *generation* is written
into the manifest first. Who read the manifest before that cannot replace it any more; who reads
it later sends under other names, and rests on no name of the generations before.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from semmap_log.core.io.object_store import ObjectStore
from semmap_log.errors import LogError
from semmap_log.fleet.shipping import since_when
from semmap_log.log.transport import (
    MANIFEST_NAME,
    KeptManifest,
    Manifest,
    Superseded,
    generation_in,
    is_object_name,
    read_manifest,
)

_MOST_RIVALS = 20


@dataclass(frozen=True, slots=True)
class Removed:
    """What was removed from a store."""

    objects: int = 0
    bytes: int = 0
    left: int = 0
    """Superseded objects that are too young."""


def remove_superseded(store: ObjectStore, log_id: str, older_ns: int) -> Removed:
    """Remove the objects that a log's manifest has not named for a time.

    Args:
        store: Where the log lies.
        log_id: The id that the log must have.
        older_ns: How long ago objects must have been superseded, by the store's clock.

    Raises:
        LogAccessError: The store denies removal; then nothing there is changed.
        LogError: Another log lies there, or its manifest changes too fast.
        CorruptLogError: The manifest is damaged.
    """
    kept = _kept(store, log_id)
    if not _due(kept, max(time.time_ns(), kept.modified_ns) - older_ns):
        return Removed(left=len(kept.manifest.superseded))
    until_ns = _store_time_ns(store) - older_ns
    kept = _replaced(store, log_id, lambda now: _with_generation(now, until_ns))
    due = _due(kept, until_ns)  # all of generations before
    for one in due:
        with suppress(FileNotFoundError):  # whoever was cut off before has removed it
            store.remove(one.name)
    kept = _replaced(store, log_id, lambda now: _without(now, {one.name for one in due}))
    return Removed(len(due), sum(one.size for one in due), len(kept.manifest.superseded))


def _due(kept: KeptManifest, until_ns: int) -> list[Superseded]:
    """Return the objects superseded before a moment of the store's clock, which may be removed."""
    named = {one.name for one in kept.manifest.segments}
    return [
        one
        for one in since_when(kept)
        if (one.since_ns or 0) <= until_ns and one.name not in named and is_object_name(one.name)
    ]


def _with_generation(kept: KeptManifest, until_ns: int) -> Manifest | None:
    """Return a manifest of the next generation, if an object is due that this one could name."""
    generation = kept.manifest.generation
    if all(generation_in(one.name) < generation for one in _due(kept, until_ns)):
        return None
    return replace(kept.manifest, superseded=since_when(kept), generation=generation + 1)


def _without(kept: KeptManifest, gone: set[str]) -> Manifest | None:
    """Return a manifest without the removed objects."""
    left = tuple(one for one in since_when(kept) if one.name not in gone)
    if len(left) == len(kept.manifest.superseded):
        return None
    return replace(kept.manifest, superseded=left)


def _replaced(
    store: ObjectStore, log_id: str, change: Callable[[KeptManifest], Manifest | None]
) -> KeptManifest:
    """Change the manifest in the store, and return it.

    Raises:
        LogError: Others keep changing it.
    """
    for _ in range(_MOST_RIVALS):
        kept = _kept(store, log_id)
        wanted = change(kept)
        if wanted is None:
            return kept
        wanted = replace(wanted, version=kept.manifest.version + 1)
        store.replace(MANIFEST_NAME, wanted.text().encode(), kept.e_tag)
    raise LogError(f"{store.url}: its manifest changes faster than it can be read; try again.")


def _kept(store: ObjectStore, log_id: str) -> KeptManifest:
    kept = read_manifest(store)
    if kept is None or kept.manifest.info.log_id != log_id:
        raise LogError(f"{store.url}: expected the log {log_id} there; nothing was removed.")
    return kept


def _store_time_ns(store: ObjectStore) -> int:
    """Return the time of the store's clock, after a check that objects may be removed.

    Raises:
        LogAccessError: They may not.
    """
    name = f".probe-{secrets.token_hex(8)}"
    store.create(name, b"1")
    try:
        return store.status(name).modified_ns
    finally:
        store.remove(name)
