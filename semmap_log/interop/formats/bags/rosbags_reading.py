"""Bags that rosbags reads: ROS 1's `.bag` and rosbag2's `.db3`.

Those that rosbag2 packed with zstd, as whole files or message by message, are unpacked first.
"""

from __future__ import annotations

import os
import sqlite3
import tempfile
from collections.abc import Collection, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from struct import unpack_from
from typing import Any
from urllib.parse import quote

from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import MAGIC, BagChannel, BagMessage, BagReader
from semmap_log.interop.formats.bags.unpacking import (
    MOST_RATIO,
    PIECE_BYTES,
    Tally,
    reason_of,
    unpack,
)
from semmap_log.interop.formats.parsing.foreign_file import open_regular
from semmap_log.interop.formats.ros.ros_types import MessageType, RosVersion, long_name, whole_topic


def open_with_rosbags(path: Path, stack: ExitStack) -> RosbagsBag:
    """Open a file, which the stack closes.

    Raises:
        FormatError: It cannot be read.
    """
    _check_not_cut(path)
    _check_no_wal(path)
    with _troubles(path):
        if path.suffix.lower() == ".bag":
            from semmap_log.interop.formats.bags.rosbag1_guarded import GuardedReader

            reader: Any = GuardedReader(path)
            version: RosVersion = 1
        else:
            from rosbags.rosbag2 import Reader as Reader2

            check_tables(path)
            reader, version = Reader2(_plainly_named(path, stack)), 2
        stack.enter_context(reader)
    return RosbagsBag(path, reader, version)


class RosbagsBag:
    """A bag that is open."""

    def __init__(self, path: Path, reader: Any, version: RosVersion) -> None:
        self._path = path
        self._reader = reader
        with _troubles(path):
            self._channels = {each.id: _channel(each, version) for each in reader.connections}

    @property
    def channels(self) -> Collection[BagChannel]:
        """All that it has."""
        return list(dict.fromkeys(self._channels.values()))

    def count(self, channels: Collection[BagChannel]) -> int:
        """Return how many messages the bag says that there are."""
        chosen = self._chosen(channels)
        return sum(each.msgcount for each in chosen)

    def messages(self, channels: Collection[BagChannel]) -> Iterator[BagMessage]:
        """Yield the messages of these channels, times ascending."""
        chosen = self._chosen(channels)
        if not chosen:
            return
        expected, count = self.count(channels), 0
        tally = Tally(self._path.stat().st_size)
        with _troubles(self._path):
            for connection, at_ns, data in self._reader.messages(chosen):
                count += 1
                tally.add(len(data))
                yield BagMessage(self._channels[connection.id], at_ns, bytes(data))
        if count != expected:
            raise FormatError(
                self._path,
                f"expected {expected:,} messages, as the bag itself says, got {count:,}; "
                "it is damaged, or its index is: rosbag reindex, ros2 bag reindex",
            )

    def _chosen(self, channels: Collection[BagChannel]) -> list[Any]:
        wanted = set(channels)
        return [each for each in self._reader.connections if self._channels[each.id] in wanted]


def _check_not_cut(path: Path) -> None:
    """Return unless the file is SQLite's, and shorter than its header says.

    Raises:
        FormatError: It is, or is no file.
    """
    with open_regular(path) as file:
        header, size = file.read(100), file.seek(0, 2)
    if len(header) < 100 or not header.startswith(b"SQLite format 3\0"):
        return
    (page,), (changes, pages), (counted_at,) = (
        unpack_from(form, header, at) for form, at in ((">H", 16), (">II", 24), (">I", 92))
    )
    expected = pages * (65536 if page == 1 else page)  # the header's, if it was kept up to date
    if changes == counted_at and size < expected:
        raise FormatError(path, f"its end is lost: expected {expected:,} bytes, got {size:,}")


def _check_no_wal(path: Path) -> None:
    """Check that SQLite does not keep some of the messages in a file next to it, which is not read.

    Raises:
        FormatError: It does: whoever wrote it was killed.
    """
    beside = path.with_name(f"{path.name}-wal")
    if beside.exists() and beside.stat().st_size:
        raise FormatError(
            path,
            f"it was not closed: a part of it is in {beside.name}; have SQLite put it together: "
            f"sqlite3 {path.name} 'pragma wal_checkpoint'",
        )


def _plainly_named(path: Path, stack: ExitStack) -> Path:
    """Return a name by which rosbags finds the file: it takes some characters for a URI's."""
    if str(path).isascii() and not set(str(path)) & set("?#%"):
        return path
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="semmap-bag-"))
    link = Path(folder) / "bag.db3"
    link.symlink_to(path.resolve())
    return link


def _channel(connection: Any, version: RosVersion) -> BagChannel:
    definition = connection.msgdef
    form = definition.format.name.lower()
    text = definition.data if form in {"msg", "idl"} else ""
    name = long_name(connection.msgtype)
    return BagChannel(
        whole_topic(connection.topic),
        MessageType(name, version, text, "idl" if form == "idl" else "msg"),
    )


@contextmanager
def _troubles(path: Path) -> Iterator[None]:
    """Turn whatever rosbags raises of damaged bytes into our error."""
    try:
        yield
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(
            path,
            f"cannot be read as a bag: {reason_of(error)} (rosbag reindex, or ros2 bag reindex, "
            "mends one that was not closed)",
        ) from error


TABLES = ("schema", "metadata", "topics", "messages", "message_definitions")


def check_tables(path: Path) -> None:
    """Return if all that is read of a bag's database are plain tables.

    Raises:
        FormatError: One is not, or the file is no database.
    """
    name = quote(os.fsencode(path.absolute()))
    try:
        with closing(sqlite3.connect(f"file:{name}?mode=ro&immutable=1", uri=True)) as database:
            for kind, table, root in database.execute(
                "SELECT type, name, rootpage FROM sqlite_master"
            ):
                is_read = str(table).lower() in TABLES
                if is_read and (kind != "table" or not root or _is_computed(database, table)):
                    raise FormatError(
                        path,
                        f"expected {table} to be a table of rosbag2, got a {kind} that computes",
                    )
    except sqlite3.Error as error:
        raise FormatError(path, f"cannot be read as a bag: {error}") from None


def _is_computed(database: sqlite3.Connection, table: str) -> bool:
    columns = database.execute("SELECT hidden FROM pragma_table_xinfo(?)", (table,))
    return any(hidden for (hidden,) in columns)


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
