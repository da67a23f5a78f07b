"""A log's files as `fleet` sends, fetches and removes them: no other package imports this module.

Segments, the folder that they lie in, the manifest of those that were shipped, and what stays of
those that were removed here. What is inside of a file is none of it.
"""

from __future__ import annotations

from semmap_log.store.bag_metadata import write_bag_metadata
from semmap_log.store.byte_layout import MANIFEST_NAME, MOST_LIST_BYTES, segment_name
from semmap_log.store.closed_mark import listed_marks, write_mark
from semmap_log.store.folder import LogFolder, Version
from semmap_log.store.lock import WriterLock
from semmap_log.store.manifest import (
    KeptManifest,
    Manifest,
    ShippedSegment,
    Superseded,
    read_manifest,
)
from semmap_log.store.object_names import generation_in, is_object_name, object_name
from semmap_log.store.reading.manifest_entry import manifest_entry
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.removed_source import kept_bytes
from semmap_log.store.reading.segment_reading import end_of, head_before, statistics_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.removed_part import (
    RemovedPart,
    kept_name,
    read_removed_part,
    write_removed_part,
)

__all__ = [
    "MANIFEST_NAME",
    "MOST_LIST_BYTES",
    "KeptManifest",
    "LogFolder",
    "LogReader",
    "Manifest",
    "RemovedPart",
    "Segment",
    "ShippedSegment",
    "Superseded",
    "Version",
    "WriterLock",
    "end_of",
    "generation_in",
    "head_before",
    "is_object_name",
    "kept_bytes",
    "kept_name",
    "listed_marks",
    "manifest_entry",
    "object_name",
    "read_manifest",
    "read_removed_part",
    "segment_name",
    "statistics_of",
    "write_bag_metadata",
    "write_mark",
    "write_removed_part",
]
