"""A log that lies somewhere else: only what was asked for is here, all else is a pattern."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.errors import LogAccessError, NotALogError
from semmap_log.store.closed_mark import ClosedMark, read_mark
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.segment_set import Listing

PATTERN = 0xA5
MOST_AT_ONCE = 10_007
"""Bytes that a verification is given in one go."""


class FarSegment:
    """A `ByteSource`: bytes are fetched when they are asked for, and forgotten when let go of."""

    def __init__(self, data: bytes, identity: Hashable, asked: list[tuple[int, int]]) -> None:
        self._far = data
        self._here = bytearray([PATTERN]) * len(data)
        self._asked = asked
        self.identity = identity
        self.size = len(data)
        self.is_guarded = True

    def need(self, start: int, end: int) -> None:
        """Fetch a range."""
        self._asked.append((start, end))
        self._here[start:end] = self._far[start:end]

    def read(self, start: int, end: int) -> memoryview:
        return self.read_ranges([(start, end)])

    def read_ranges(self, ranges: Sequence[tuple[int, int]]) -> memoryview:
        for start, end in ranges:
            self.need(max(0, start), min(end, self.size))
        return memoryview(b"".join(self._here[start:end] for start, end in ranges))

    def will_need(self, start: int, end: int) -> None:
        """Nothing: a hint may be passed over."""

    def let_go(self, start: int, end: int) -> None:
        self._here[start:end] = bytes([PATTERN]) * len(self._here[start:end])


class FarFile(FarSegment):
    """The same, as a verification takes it: an `OpenedFile`."""

    is_regular = True

    def read_into(self, target: memoryview, at: int) -> int:
        """Give a little at a time, as a socket does."""
        data = self.read(at, min(at + MOST_AT_ONCE, at + len(target)))
        target[: len(data)] = data
        return len(data)


class FarSegments:
    """A `SegmentStore` over the files of a folder, of which only whole objects can be listed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.path = self.given = Path("far") / folder.name
        self.asked: dict[str, list[tuple[int, int]]] = {}
        """Of each segment, the ranges that were fetched."""

    def segments(self) -> Listing:
        found: Listing = [
            (file.name, file.stat().st_ino) for file in sorted(self._folder.glob("*.mcap"))
        ]
        if not found:
            raise NotALogError(f"{self.path}: no segments.")
        return found

    def open(self, name: str) -> FarSegment:
        file = self._folder / name
        try:
            data, inode = file.read_bytes(), file.stat().st_ino
        except FileNotFoundError as error:
            raise LogAccessError(f"{self.path / name}: is gone.") from error
        return FarSegment(data, f"object {inode}", self.asked.setdefault(name, []))

    def size_of(self, name: str) -> int:
        return (self._folder / name).stat().st_size

    def told(self, _name: str) -> None:
        """
        Nothing: each is opened.
        """

    def mark(self) -> ClosedMark | None:
        return read_mark(LogFolder(self._folder))

    def closed_names(self) -> list[str]:
        return []

    def bytes_asked(self) -> int:
        """Return how many bytes were fetched, each counted as often as it was."""
        return sum(end - start for ranges in self.asked.values() for start, end in ranges)


class FarPlace:
    """A `FilePlace` over the same files."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.path = Path("far") / folder.name

    def is_folder(self) -> bool:
        return True

    def files(self) -> list[Path]:
        return [self.path / file.name for file in self._folder.iterdir()]

    @contextmanager
    def opened(self, file: Path) -> Iterator[FarFile]:
        here = self._folder / file.name
        yield FarFile(here.read_bytes(), f"object {here.stat().st_ino}", [])

    def mark(self) -> ClosedMark | None:
        return read_mark(LogFolder(self._folder))

    def flaws(self) -> tuple[()]:
        """
        Nothing is known of them.
        """
        return ()

    def differences(self, _found: object) -> tuple[()]:
        return ()

    def removed(self) -> None:
        pass

    def bag_metadata(self) -> str:
        file = self._folder / BAG_METADATA_NAME
        return file.read_text() if file.exists() else ""
