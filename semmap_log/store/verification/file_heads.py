"""The files that a verification reads: what their heads say, and their bytes, whatever the disk."""

from __future__ import annotations

import struct
from collections.abc import Hashable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import PurePath

from mcap.opcode import Opcode
from mcap.records import Header, Metadata

from semmap_log.core.messages import LIBRARY, PROFILE
from semmap_log.errors import LogAccessError, LogError, NewerLogError
from semmap_log.store import byte_layout
from semmap_log.store import records as mcap
from semmap_log.store.header import OtherVersionError, SegmentHeader
from semmap_log.store.verification.file_place import FileBytes, FilePlace, OpenedFile, Vanished

HEAD_BYTES = 2**16
"""The header lies well within; a longer one is not ours."""
FOOTER_BYTES = 9 + 20 + len(mcap.MAGIC)

_MARKS = (byte_layout.LOG_METADATA.encode(), b"hash_so_far")
"""Both stand in every head: one flipped bit leaves one of them."""


@dataclass(frozen=True, slots=True)
class SegmentFile:
    """A file that is, or was, a segment: what its head says."""

    path: PurePath
    size: int
    identity: Hashable
    """What distinguishes it from another file of its name."""
    header: SegmentHeader | None
    """None: it cannot be read."""
    header_end: int
    """Where the records after the header begin; 0 without a header."""
    problem: str
    """Why the header cannot be read."""
    is_closed: bool
    """Whether it ends in a footer."""

    @property
    def named_number(self) -> int | None:
        """The number that its name gives it; None: its name has none."""
        return byte_layout.number_in(self.path.name)

    @property
    def number(self) -> int:
        """Its place among the segments: what its header says, else its name."""
        if self.header is not None:
            return self.header.number
        return -1 if self.named_number is None else self.named_number

    @property
    def last_number(self) -> int:
        """The last of the segments that were merged into it."""
        return self.number if self.header is None else self.header.last_number


def name_of(file: SegmentFile, number: int) -> PurePath:
    """Return the name that the segment of another number must have next to this one."""
    return file.path.with_name(
        byte_layout.segment_name(byte_layout.stem_of(file.path.name), number)
    )


def look_at(place: FilePlace, path: PurePath) -> SegmentFile | None:
    """Return what the head of a place's file says; None if the file is not ours.

    Raises:
        LogAccessError: It cannot be opened.
        Vanished: It is gone.
        NewerLogError: A later major version has written it.
        LogError: It is of an older one.
    """
    with _opened(place, path) as file:
        if not file.is_regular:
            return None
        data = FileBytes(path, file)
        head = bytes(data[:HEAD_BYTES])
        is_named_like_ours = bool(data.unreadable) and byte_layout.number_in(path.name) is not None
        if not (_is_ours(head) or is_named_like_ours):
            return None
        foot = bytes(data[max(0, file.size - FOOTER_BYTES) :])
        # An end that the disk does not give is taken for that of a closed segment: no torn tail.
        is_closed = _ends_in_footer(foot) or file.size in [end for _, end in data.unreadable]
    header, end, problem = _header_of(path, head)
    return SegmentFile(path, file.size, file.identity, header, end, problem, is_closed)


@contextmanager
def bytes_of(place: FilePlace, file: SegmentFile) -> Iterator[FileBytes]:
    """Hand out the bytes of a place's file.

    A live segment may have grown since it was listed; that is seen, too.

    Raises:
        Vanished: The file is gone, or another has its name.
    """
    with _opened(place, file.path) as now:
        if now.identity != file.identity or now.size < file.size:
            raise Vanished(file.path)
        yield FileBytes(file.path, now)


@cache
def first_bytes() -> bytes:
    """Return the bytes with which every segment begins: magic and Header."""
    return mcap.MAGIC + mcap.record(Header(profile=PROFILE, library=LIBRARY))


def _is_ours(head: bytes) -> bool:
    """Return whether a file is a segment of ours, or was one before some bytes were damaged."""
    return any(mark in head for mark in _MARKS) or (
        bool(head) and first_bytes().startswith(head[: len(first_bytes())])
    )


def _header_of(path: PurePath, head: bytes) -> tuple[SegmentHeader | None, int, str]:
    """Return the header, where it ends, and what is wrong with it."""
    start = len(first_bytes())
    problem = "" if head.startswith(first_bytes()) else "its magic or its Header record"
    try:
        opcode, length = mcap.FRAME.unpack_from(head, start)
        end = start + mcap.FRAME.size + length
        if opcode != Opcode.METADATA or end > len(head):
            return None, 0, f"no Metadata {byte_layout.LOG_METADATA} where it must be"
        metadata = mcap.read_record(Metadata, head[start + mcap.FRAME.size : end])
        header = SegmentHeader.from_metadata(metadata)
    except OtherVersionError as error:
        raise (NewerLogError if error.is_newer else LogError)(f"{path}: {error}.") from None
    except (ValueError, struct.error) as error:
        return None, 0, f"its Metadata {byte_layout.LOG_METADATA}: {error}"
    # Its own length is believed no more. How a later version orders its entries is not known.
    expected = mcap.record(metadata if header.others else header.to_metadata())
    if expected != head[start : start + len(expected)]:
        problem = f"its Metadata {byte_layout.LOG_METADATA} is not as it is written"
    return header, start + len(expected), problem


def _ends_in_footer(foot: bytes) -> bool:
    if len(foot) < FOOTER_BYTES or not foot.endswith(mcap.MAGIC):
        return False
    return bool(mcap.FRAME.unpack_from(foot) == (Opcode.FOOTER, 20))


@contextmanager
def _opened(place: FilePlace, path: PurePath) -> Iterator[OpenedFile]:
    with ExitStack() as stack:
        try:
            file = stack.enter_context(place.opened(path))
        except FileNotFoundError:
            raise Vanished(path) from None
        except OSError as error:
            raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
        yield file
