"""Small segments that become one: which, in what order of steps, and what a crash leaves of it.

The merged file takes the first one's name, then the others are removed. A crash in between leaves
*leftovers*: whole segments that lie inside the merged one. Readers pass over them; the next
compaction removes them. `metadata.yaml` lists only the first from before the swap on, with what it
will hold: so rosbag2's tools never meet a file that is missing, nor a message twice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from semmap_log.log.bag_metadata import ClosedSegment, write_bag_metadata
from semmap_log.log.chunks import StoredChunk
from semmap_log.log.disk import sync_folder
from semmap_log.log.form import ROLL_BYTES
from semmap_log.log.header import SegmentHeader
from semmap_log.log.pages import Page
from semmap_log.log.reader import read_chunk, segment_paths
from semmap_log.log.rechunk import Pause, needs_compaction, rechunked
from semmap_log.log.scan import Segment, map_file, open_segment, read_head

MERGE_BYTES = ROLL_BYTES
"""Records that a merged segment holds at most, uncompressed."""


Listing = dict[Path, ClosedSegment]
"""What metadata.yaml lists, by path, in order."""


@dataclass(frozen=True, slots=True)
class Step:
    """Adjacent closed segments that become one file; often only one, to be rechunked."""

    sources: tuple[Segment, ...]

    @property
    def size(self) -> int:
        """Bytes of its records, uncompressed."""
        return sum(_size(segment) for segment in self.sources)

    def run(self, folder: Path, listed: Listing, pause: Pause) -> Listing:
        """Do it; wherever it stops, the folder holds the log, as it was or as it will be.

        Args:
            folder: The log; its writer's lock is held.
            listed: All its closed segments, by path, in order.
            pause: Called between chunks.

        Returns:
            The closed segments afterwards.

        Raises:
            CorruptLogError: A segment is damaged; all stay as they are.
            OSError: As the file system says.
        """
        first, *others = (segment.path for segment in self.sources)
        with rechunked(self.sources, pause) as copy:
            listed = {path: said for path, said in listed.items() if path not in others}
            listed[first] = ClosedSegment.of(first, copy.statistics())
            if others:
                write_bag_metadata(folder, listed.values())
            copy.install()
        for path in others:
            path.unlink()
        sync_folder(folder)
        return listed


def plan(closed: Sequence[Segment], *, merge: bool) -> list[Step]:
    """Return what there is to do about the closed segments of a log, in order.

    What was done once is not planned again: merged segments hold more than half of what they may,
    or have a neighbour that would not fit.
    """
    groups = _small_neighbours(closed) if merge else ((segment,) for segment in closed)
    return [Step(group) for group in groups if len(group) > 1 or needs_compaction(group[0])]


def _small_neighbours(closed: Sequence[Segment]) -> Iterator[tuple[Segment, ...]]:
    """Yield adjacent segments in groups that fit into one; one that is half full stays alone."""
    group: list[Segment] = []
    room = 0
    for segment in closed:
        size = _size(segment)
        if size > room or size > MERGE_BYTES // 2:
            if group:
                yield tuple(group)
            group, room = [], MERGE_BYTES if size <= MERGE_BYTES // 2 else size
        group.append(segment)
        room -= size
    if group:
        yield tuple(group)


def _size(segment: Segment) -> int:
    return sum(chunk.size for chunk in segment.chunks)


def remove_merged(folder: Path) -> list[Path]:
    """Remove segments that lie wholly inside a merged one; only for who holds the writer's lock.

    Returns:
        What was removed.

    Raises:
        CorruptLogError: The merged segment is damaged; nothing is removed.
    """
    removed: list[Path] = []
    for whole, parts in _overlaps(folder):
        hashes = _commit_hashes(open_segment(whole))
        for part in parts:
            if _ends_in(part, hashes):
                part.unlink()
                removed.append(part)
    if removed:
        sync_folder(folder)
    return removed


def _overlaps(folder: Path) -> list[tuple[Path, list[Path]]]:
    """Return merged segments with the others whose numbers lie inside theirs."""
    headers = {path: read_head(path, map_file(path))[0] for path in segment_paths(folder)}
    found = []
    for whole, header in headers.items():
        if header.last_number > header.number:
            parts = [p for p, h in headers.items() if p != whole and _inside(h, header)]
            if parts:
                found.append((whole, parts))
    return found


def _inside(part: SegmentHeader, whole: SegmentHeader) -> bool:
    return (
        part.info == whole.info
        and whole.number <= part.number
        and part.last_number <= whole.last_number
        and part.last_number - part.number < whole.last_number - whole.number
    )


def _commit_hashes(segment: Segment) -> set[bytes]:
    """Return the hashes of all commits of a segment, and the one before them."""
    hashes = {segment.header.hash_so_far}
    for chunk in segment.chunks:
        hashes.update(commit.hash for commit in _page(segment, chunk).commits())
    return hashes


def _ends_in(path: Path, hashes: set[bytes]) -> bool:
    """Tell whether a segment's last commit is one of these: then all before it are, too."""
    part = open_segment(path)
    for chunk in reversed(part.chunks):
        commits = _page(part, chunk).commits()
        if commits:
            return commits[-1].hash in hashes
    return part.header.hash_so_far in hashes


def _page(segment: Segment, chunk: StoredChunk) -> Page:
    return Page(read_chunk(segment, chunk), segment.header.first_event, segment.path, chunk.offset)
