"""The beginning of a damaged log whose oldest events are no longer kept: it is taken over whole.

Behind its horizon a log rests on the keyframe there, and the events before it have the numbers
that the keyframe knows them by. So the first segment comes into the new log as it is, numbers,
gaps and tombstones; what survives behind it follows without gaps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from semmap_log.core.model.events import HistoryTrimmed
from semmap_log.errors import LogError
from semmap_log.store.chunks import build_chunk
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import KEYFRAME_CHANNEL, segment_name
from semmap_log.store.header import LogInfo, Trimmed
from semmap_log.store.kind_bits import KEYFRAME_BIT
from semmap_log.store.pages import Page
from semmap_log.store.reading.segment_reading import end_of, page_at
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.records import MESSAGE
from semmap_log.store.salvage.split_commit import SplitSegment
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.trimming.records_left import SEQUENCE_RANGE, KeptRecords
from semmap_log.store.verification import Severity, Verification
from semmap_log.store.verification.file_heads import bytes_of
from semmap_log.store.verification.folder_files import FolderFiles
from semmap_log.store.verification.pieces import Piece
from semmap_log.store.verification.walk import SegmentWalk
from semmap_log.store.writing.keyframe_source import KeyframeMessage, keyframe_chunk


@dataclass(frozen=True, slots=True)
class KeptBeginning:
    """A first segment that has a horizon, whole."""

    segment: Segment
    trimmed: Trimmed
    state: bytes | None
    """The Keyframe message at the horizon, where that stands at the head of the next segment."""
    is_split: bool = False
    """Whether its horizon lies within a commit, which becomes two: `split_commit`."""

    @property
    def next_event(self) -> int:
        """Number of the first event behind it."""
        return end_of(self.segment)

    @property
    def events(self) -> int:
        """How many events it holds."""
        return int(self.segment.spans["events"].sum())

    def copy_to(self, folder: LogFolder, name: str, info: LogInfo) -> SegmentWriter:
        """Write it as the first segment of a new log, closed and installed, with its keyframe.

        Raises:
            CorruptLogError: It is damaged.
            OSError: As the file system says.
        """
        header = replace(self.segment.full_header, info=info)
        writer = SegmentWriter(folder, segment_name(name, header.number), header)
        try:
            for records, next_event in self._parts():
                page = Page(records, header.first_event, writer.path)
                chunk = build_chunk(records, page.offsets, compression="zstd")
                writer.add(chunk, levels=page.levels, next_event=next_event)
            if self.state is not None:
                keyframe = KeyframeMessage(self.next_event - 1, self.state)
                chunk = keyframe_chunk(keyframe, writer.statistics().message_end_time)
                writer.add(chunk, next_event=self.next_event)
            writer.close()
            writer.install()
        except BaseException:
            writer.abandon()
            raise
        return writer

    def _parts(self) -> Iterator[KeptRecords]:
        if self.is_split:
            yield from SplitSegment(self.segment, self.trimmed.horizon).parts()
            return
        for i, next_event in enumerate(self.segment.next_events.tolist()):
            yield KeptRecords(bytes(page_at(self.segment, i).records), next_event)


def kept_below(found: FolderFiles) -> int:
    """Return below which number a log's events are taken over as they are; 0: none is."""
    header = found.segments[0].header if found.segments else None
    trimmed = None if header is None else header.trimmed
    return trimmed.next_event if trimmed is not None and trimmed.horizon else 0


def kept_beginning(
    found: FolderFiles, verified: Verification, told: HistoryTrimmed | None
) -> KeptBeginning | None:
    """Return the beginning of a damaged log that has a horizon; None: it has none.

    Args:
        found: Its files.
        verified: What is wrong with it.
        told: What it last said of what was taken out of it: its first segment may be gone.

    Raises:
        LogError: The beginning itself, or the state at the horizon, is damaged.
    """
    if not kept_below(found) and (told is None or not told.horizon):
        return None
    path = found.segments[0].path
    try:
        segment = open_segment(Path(path))
        trimmed = segment.header.trimmed
        damage = [finding for finding in verified.of(Severity.DAMAGE) if finding.path == path]
        if not damage and trimmed is not None and trimmed.horizon:
            return KeptBeginning(segment, trimmed, _state_behind(found, segment, trimmed))
        if [finding.kind for finding in damage] == ["keyframe"] and trimmed is not None:
            SplitSegment(segment, trimmed.horizon)  # raises where that is not what is wrong
            return KeptBeginning(segment, trimmed, None, is_split=True)
    except (LogError, IndexError):
        pass
    raise LogError(
        f"{found.folder}: damaged, and not to be recovered: nothing but the state at its horizon "
        "is left of what was before, and that, or the segment before it, is damaged. Nothing was "
        "changed; put back the damaged files from a copy of the log as it was trimmed."
    )


def _state_behind(found: FolderFiles, segment: Segment, trimmed: Trimmed) -> bytes | None:
    """Return the keyframe at the head of the second segment, if the state at the horizon is there.

    Of that segment no more need be whole than the chunk with it.

    Raises:
        IndexError: It is damaged, or is not there.
    """
    is_keyframe = segment.chunks.rows["kinds"] == KEYFRAME_BIT
    if (is_keyframe & (segment.next_events == trimmed.horizon)).any():
        return None
    behind = found.segments[1]
    with bytes_of(found.place, behind) as data:
        walk = SegmentWalk(data, behind.header_end, behind.header)
        first = next((item for item in walk if isinstance(item, Piece)), None)
    if first is None or first.messages[0][0] != KEYFRAME_CHANNEL:
        raise IndexError
    _, sequence, _, _, start, end = first.messages[0]
    if sequence != (trimmed.horizon - 1) % SEQUENCE_RANGE:
        raise IndexError
    return bytes(first.records[start + MESSAGE.size : end])
