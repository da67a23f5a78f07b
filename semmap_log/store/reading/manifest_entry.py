"""The manifest entry of a segment, made from the segment itself."""

from __future__ import annotations

from semmap_log.store.manifest import ShippedSegment
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment


def manifest_entry(segment: Segment, name: str, sha256: str) -> ShippedSegment:
    """Return the entry of a closed segment.

    Args:
        segment: Nothing of it comes from another manifest.
        name: Of its object.
        sha256: Of all its bytes, in hexadecimal digits.

    Raises:
        CorruptLogError: What closed it is damaged.
    """
    return ShippedSegment(
        name, segment.size, sha256, segment.full_header, segment.head_end, end_of(segment),
        segment.head, dict(segment.counts or {}), segment.recorded, segment.span,
    )  # fmt: skip
