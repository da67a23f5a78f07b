"""The trimmed copy of a segment, checked before it takes the segment's place."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath

from semmap_log.core.io.byte_source import ByteSource
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.keyframe_check import ReplayKeyframeCheck
from semmap_log.log.replay.state import keyframe_at
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window
from semmap_log.store.verification import Severity, Verifier
from semmap_log.store.verification.file_place import DiskPlace, OpenedFile


def check_copy(log: LogReader, copy: Segment) -> None:
    """Check that a log can be opened, read and verified with the trimmed copy of a segment.

    Args:
        log: The log with the copy in the place of the segments that it stands for.
        copy: The copy, under the path that it will have.

    Raises:
        CorruptLogError: It cannot; the message says that the log is unchanged.
    """
    try:
        _read(log, copy)
    except CorruptLogError as error:
        raise _refusal(copy, str(error)) from error
    for finding in Verifier(_CopyPlace(copy), ReplayKeyframeCheck).run().findings:
        if finding.severity >= Severity.TORN:
            raise _refusal(copy, f"byte {finding.offset}: {finding.text}")


def _read(log: LogReader, copy: Segment) -> None:
    """Read what the copy holds, and the state at the log's horizon."""
    window = Window(first_event=copy.header.first_event, before_event=end_of(copy))
    for _ in log.batches(window, is_part=True, with_newer=True):
        pass
    if log.horizon:
        place = log.horizon_place()
        segment = log.segments[place.segment]
        state = keyframe_at(segment, place.chunk)
        if state is None or state.event != log.horizon - 1:
            problem = f"no state of event {log.horizon - 1}, the last before its horizon"
            raise CorruptLogError(segment.path, None, problem)


class _CopyPlace(DiskPlace):
    """One file: the copy's bytes, which lie under a temporary name."""

    def __init__(self, copy: Segment) -> None:
        super().__init__(Path(copy.path))
        self._source = copy.source

    @contextmanager
    def opened(self, _file: PurePath) -> Iterator[OpenedFile]:
        """Return the copy's bytes."""
        yield _CopyFile(self._source)


class _CopyFile:
    """An `OpenedFile` of bytes that are mapped already."""

    is_regular = True

    def __init__(self, source: ByteSource) -> None:
        self.size, self.identity, self._source = source.size, source.identity, source

    def read_into(self, target: memoryview, at: int) -> int:
        """Fill in bytes from an offset on; return how many."""
        data = self._source.read(at, at + len(target))
        target[: len(data)] = data
        return len(data)


def _refusal(copy: Segment, problem: str) -> CorruptLogError:
    return CorruptLogError(
        copy.path,
        None,
        f"the trimmed copy of it failed its check ({problem}); the log was left as it was. "
        "Please report this.",
    )
