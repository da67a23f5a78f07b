"""A segment's copy before it has its name: written, synced, and verified as it lies there.

It has a name of its own, always the same: a copying that was stopped finds there what it has done.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import PurePath

from semmap_log.core.io.byte_source import blocks
from semmap_log.core.io.disk import TEMPORARY_SUFFIX
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.verification import verify
from semmap_log.store.verification.file_place import DiskFile, DiskPlace
from semmap_log.store.verification.findings import Severity, Verification
from semmap_log.store.verification.keyframe_place import NewKeyframeCheck

Told = Callable[[int], None]
"""Called with how many bytes more are done."""


@dataclass(frozen=True, slots=True)
class StagedFile:
    """A segment of a log, and where its copy is made."""

    folder: LogFolder
    """Of the copy."""
    segment: Segment
    name: str
    """What the copy is to be called."""

    @property
    def size(self) -> int:
        """Bytes that are copied: of a live segment all up to its last whole commit."""
        return self.segment.size if self.segment.closed else self.segment.whole_end

    @property
    def temporary(self) -> str:
        """What it is called until then."""
        return f".{self.name}.copied{TEMPORARY_SUFFIX}"

    def make(self, new_check: NewKeyframeCheck, told: Told) -> None:
        """Write and verify it; what an earlier copying has written is only verified.

        Raises:
            CorruptLogError: The log's own file is damaged; nothing of it is left here.
            OSError: As the system says; nothing of it is left here.
        """
        if self.is_written():
            with suppress(CorruptLogError):
                self.verify(new_check, _nobody)
                told(2 * self.size)
                return
        self.write(told)
        self.verify(new_check, told)

    def is_written(self) -> bool:
        """Tell whether a copying that was stopped has written it: as long, and closed alike."""
        try:
            if self.folder.status(self.temporary).st_size != self.size:
                return False
            there = map_file(self.folder / self.temporary, self.folder)
        except (OSError, LogError):
            return False
        ends = (self.segment.whole_end, self.size) if self.segment.closed else (0, self.size)
        return all(
            ours == theirs
            for ours, theirs in zip(
                blocks(self.segment.source, *ends), blocks(there, *ends), strict=True
            )
        )

    def write(self, told: Told) -> None:
        """Write it, synced.

        Raises:
            CorruptLogError: The log's disk does not give its bytes.
            OSError: As the system says; what was written is removed.
        """
        self.folder.remove(self.temporary)
        fd = self.folder.open(self.temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        try:
            with os.fdopen(fd, "wb") as file:
                for block in blocks(self.segment.source, 0, self.size):
                    file.write(block)
                    told(len(block))
                file.flush()
                os.fsync(fd)
        except BaseException:
            self.folder.remove(self.temporary)
            raise

    def verify(self, new_check: NewKeyframeCheck, told: Told) -> None:
        """Read all of it, and check that it is good, and ends where the log's own segment ends.

        Raises:
            CorruptLogError: It is not: names the log's own file.
        """
        before = 0

        def progress(done: int, _total: int) -> None:
            nonlocal before
            told(done - before)
            before = done

        place = _OneFile(self.folder, self.name, self.temporary)
        found = verify(place, new_check, progress=progress)
        told(self.size - before)
        try:
            self._check(found)
        except CorruptLogError:
            self.folder.remove(self.temporary)
            raise

    def _check(self, found: Verification) -> None:
        segment = self.segment
        wrong = found.of(Severity.DAMAGE, Severity.TORN, Severity.NOT_A_LOG)
        if wrong:
            raise CorruptLogError(segment.path, wrong[0].offset, f"{wrong[0].text}; {_AS_IT_WAS}")
        events = int(segment.spans["events"].sum())
        is_empty = end_of(segment) == segment.header.first_event
        if (found.events, found.head) != (events, found.head if is_empty else segment.head):
            problem = f"expected {events} events up to the hash {segment.head.hex()[:16]}…, got "
            problem += f"{found.events} up to {found.head.hex()[:16]}…; {_AS_IT_WAS}"
            raise CorruptLogError(segment.path, None, problem)

    def put(self) -> None:
        """Give it its name; it survives a power cut.

        Raises:
            OSError: As the system says.
        """
        self.folder.put(self.temporary, self.name)


def _nobody(_more: int) -> None:
    """Tell nobody."""


_AS_IT_WAS = "it was not copied, and the copy is as it was"


class _OneFile(DiskPlace):
    """A `FilePlace`: one segment, which lies under another name."""

    def __init__(self, folder: LogFolder, name: str, lies_at: str) -> None:
        super().__init__(folder / name)
        self._folder = folder
        self._lies_at = lies_at

    def is_folder(self) -> bool:
        """Return that it is none."""
        return False

    @contextmanager
    def opened(self, file: PurePath) -> Iterator[DiskFile]:
        """Open it; as `FilePlace.opened`."""
        del file
        fd = self._folder.open_to_read(self._lies_at)
        try:
            yield DiskFile(fd)
        finally:
            os.close(fd)


def problem_in_place(folder: LogFolder, name: str, new_check: NewKeyframeCheck) -> str:
    """Read all of a segment that lies in a folder, and return what is wrong; empty: nothing."""
    found = verify(_OneFile(folder, name, name), new_check)
    return found.findings[0].text if found.exit_code else ""
