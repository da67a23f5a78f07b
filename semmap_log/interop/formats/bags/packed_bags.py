"""Bags that rosbag2 packed with zstd: whole files, or each message."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import BagChannel, BagMessage, BagReader
from semmap_log.interop.formats.bags.mcap_reading import MAGIC
from semmap_log.interop.formats.bags.unpacking import MOST_RATIO, PIECE_BYTES, Tally, unpack
from semmap_log.interop.formats.parsing.foreign_file import open_regular

_BEGINNINGS = (MAGIC, b"SQLite format 3\0")
FREE_FILE_BYTES = 2**30
"""A packed file may hold so much, or a thousand times its own bytes."""


class PackedMessages:
    """A bag whose messages are packed one by one."""

    def __init__(self, path: Path, bag: BagReader) -> None:
        self._path = path
        self._bag = bag

    @property
    def channels(self) -> Collection[BagChannel]:
        """All that it has."""
        return self._bag.channels

    def count(self, channels: Collection[BagChannel]) -> int:
        """Return how many messages the bag says that there are."""
        return self._bag.count(channels)

    def messages(self, channels: Collection[BagChannel]) -> Iterator[BagMessage]:
        """Yield the messages of these channels, unpacked, times ascending.

        Raises:
            FormatError: One is damaged, or too large.
        """
        tally = Tally(self._path.stat().st_size)
        for message in self._bag.messages(channels):
            try:
                data = unpack(message.data, "zstd")
                tally.add(len(data))
            except ValueError as error:
                problem = f"a message on {message.channel.topic}: {error}"
                raise FormatError(self._path, problem) from None
            yield replace(message, data=data)


def unpacked_files(files: list[Path], stack: ExitStack) -> list[Path]:
    """Return the files of a bag, unpacked into a folder that the stack removes.

    Raises:
        FormatError: One is no zstd, or holds too much.
    """
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="semmap-bag-"))
    made = []
    for number, file in enumerate(files):
        target = Path(folder) / f"{number}{file.with_suffix('').suffix}"
        _unpack_file(file, target)
        made.append(target)
    return made


def _unpack_file(source: Path, target: Path) -> None:
    import zstandard

    with open_regular(source) as packed, target.open("xb") as file:
        most = max(FREE_FILE_BYTES, MOST_RATIO * packed.seek(0, 2))
        packed.seek(0)
        try:
            with zstandard.ZstdDecompressor().stream_reader(packed, closefd=False) as stream:
                if not (piece := stream.read(PIECE_BYTES)).startswith(_BEGINNINGS):
                    raise FormatError(source, "expected a packed .mcap or .db3, got something else")
                while piece:
                    most -= len(piece)
                    if most < 0:
                        raise FormatError(
                            source, "expected at most 1 GiB, or 1,000 times its own bytes, "
                            "unpacked; got more; unpack it yourself: zstd -d",
                        )  # fmt: skip
                    file.write(piece)
                    piece = stream.read(PIECE_BYTES)
        except (zstandard.ZstdError, OSError) as error:
            raise FormatError(source, f"cannot be unpacked: {error}") from None
