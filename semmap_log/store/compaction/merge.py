"""Small segments that become one: which, in what order of steps, and what a crash leaves of it.

The merged file takes the first one's name; the others are *leftovers* then: whole segments that lie
inside the merged one. Readers pass over them, and they stay for an hour: `cp -r` lists the names
first, and may have copied the first file as it was before the merge. Who writes later, or compacts,
removes them. `metadata.yaml` lists only the first from before the swap on, with what it
will hold: so rosbag2's tools never meet a file that is missing, nor a message twice.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from stat import S_ISDIR

from semmap_log.store.bag_metadata import ClosedSegment, write_bag_metadata
from semmap_log.store.compaction.rechunk import needs_compaction, rechunked
from semmap_log.store.compaction.repaging import Pause
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import ROLL_BYTES
from semmap_log.store.reading.segment_scan import Segment

MERGE_BYTES = ROLL_BYTES
"""Records that a merged segment holds at most, uncompressed."""


MERGED_KEPT_S = 3600
"""So long files stay that were merged into another: a copy of the folder may take as long."""

Listing = dict[PurePath, ClosedSegment]
"""What metadata.yaml lists, by path, in order."""


@dataclass(frozen=True, slots=True)
class Step:
    """Adjacent closed segments that become one file; often only one, to be rechunked."""

    sources: tuple[Segment, ...]

    @property
    def size(self) -> int:
        """Bytes of its records, uncompressed."""
        return sum(_size(segment) for segment in self.sources)

    def run(self, folder: LogFolder, listed: Listing, pause: Pause) -> Listing:
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
        with rechunked(folder, self.sources, pause) as copy:
            listed = {path: said for path, said in listed.items() if path not in others}
            listed[first] = copy.closed_segment()
            if others:
                write_bag_metadata(folder, listed.values())
            copy.install(replacing=self.sources[0].source.identity)
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
        is_trimmed = segment.header.trimmed is not None  # its Tombstones are of one segment
        size = MERGE_BYTES if is_trimmed else _size(segment)
        if size > room or size > MERGE_BYTES // 2:
            if group:
                yield tuple(group)
            group, room = [], MERGE_BYTES if size <= MERGE_BYTES // 2 else size
        group.append(segment)
        room -= size
    if group:
        yield tuple(group)


def _size(segment: Segment) -> int:
    return int(segment.chunks.rows["size"].sum())


@dataclass(frozen=True, slots=True)
class MergedFiles:
    """Files whose segments lie in merged ones, and these, by name."""

    parts: tuple[str, ...] = ()
    wholes: tuple[str, ...] = ()

    @classmethod
    def of(cls, segments: Sequence[Segment], leftovers: Sequence[PurePath]) -> MergedFiles:
        """Return those of a log, from what a reader has found."""
        wholes = [s.path.name for s in segments if s.header.last_number > s.header.number]
        return cls(tuple(path.name for path in leftovers), tuple(wholes))

    def remove(self, folder: LogFolder, keep_s: float | None = None) -> MergedFiles:
        """Remove the parts, once no copy of the folder can need them; return what stays for now.

        Only for who holds the writer's lock, and has opened the reader since.

        Args:
            folder: The log's.
            keep_s: How old the last merge must be; default: an hour.

        Raises:
            OSError: As the file system says.
        """
        if not self.parts:
            return self
        last_s = max(folder.status(name, follows=True).st_mtime for name in self.wholes)
        if time.time() - last_s < (MERGED_KEPT_S if keep_s is None else keep_s):
            return self
        folder.sync()  # the merged file's name may not be on the disk yet; they are
        for name in self.parts:
            if not S_ISDIR(folder.status(name).st_mode):
                folder.remove(name)
        folder.sync()
        return MergedFiles()
