"""Bags of other programs: `.bag` (ROS 1), a rosbag2 folder or `.db3`, `.mcap` of either ROS.

Messages come in the order of their times, in flat memory, with the bag's own definitions of their
types. What other readers silently take for empty (no index, an end that was never written) is
read, or is an error that says so. A rosbag2 folder is read file after file, also files that
metadata.yaml lacks.

`new_bag` writes a bag that ROS's players open: `.mcap`, `.bag` (ROS 1, noetic) or a folder
(rosbag2). It is there whole or not at all: written under a temporary name, synced, then renamed.
The same messages give the same bytes.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Literal

from semmap_log.core.io.disk import atomic_file, atomic_folder, output_errors
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import (
    BagChannel,
    BagMessage,
    BagReader,
    BagTopic,
    McapBag,
    NewBag,
)
from semmap_log.interop.formats.bags.rosbags_reading import (
    PackedMessages,
    open_with_rosbags,
    unpacked_files,
)
from semmap_log.interop.formats.parsing.foreign_file import MIB, read_capped
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.formats.parsing.strict_yaml import Mapping, Node, Scalar, parse_yaml
from semmap_log.interop.formats.parsing.strict_yaml import Sequence as YamlList
from semmap_log.interop.formats.ros.ros_types import RosVersion, encoded, ros_types

READABLE_BAGS = ".bag (ROS 1), a rosbag2 folder, .db3, .mcap"


@contextmanager
def open_bag(path: Path) -> Iterator[BagReader]:
    """Open a bag for reading.

    Raises:
        FormatError: It is none, cannot be read, or is a log of ours.
    """
    with ExitStack() as stack:
        yield _opened(path, stack)


def is_bag(path: Path) -> bool:
    """Return whether a name, or a folder, is that of a bag."""
    return path.suffix.lower() in _FILES or path.is_dir()


def files_of(path: Path) -> list[Path]:
    """Return the files that a bag is made of, in their order."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.is_file())


_FILES = frozenset({".bag", ".mcap", ".db3"})


def _opened(path: Path, stack: ExitStack) -> BagReader:
    if path.is_dir():
        return open_folder(path, stack)
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        from semmap_log.interop.formats.bags.bag_protocol import McapBag

        return McapBag.open(path, stack)
    if suffix in _FILES:
        from semmap_log.interop.formats.bags.rosbags_reading import open_with_rosbags

        return open_with_rosbags(path, stack)
    raise FormatError(path, f"unknown extension for a bag; expected one of: {READABLE_BAGS}")


def open_folder(folder: Path, stack: ExitStack) -> BagReader:
    """Open the files of a folder, which the stack closes.

    rosbags, given a folder, passes over messages in silence where a file and metadata.yaml differ
    in a topic's QoS, and unpacks whatever is packed; so each file is opened by itself.

    Raises:
        FormatError: It is no bag, a log of ours, or a file is missing or cannot be read.
    """
    metadata = folder / BAG_METADATA_NAME
    if not metadata.exists():
        return _Files([_open(file, stack) for file in _bags_in(folder)])
    found = _Metadata(metadata)
    files = [_in_folder(folder, name) for name in found.files]
    if found.packed == "file":
        files = unpacked_files(files, stack)
    bags = [_open(file, stack) for file in files]
    if found.packed == "message":
        bags = [PackedMessages(file, bag) for file, bag in zip(files, bags, strict=True)]
    return _Files(bags)


def _in_folder(folder: Path, name: str) -> Path:
    """Return where a file of a bag is: up to version 4 its name begins with a folder's."""
    whole = folder / name
    return whole if whole.exists() else folder / whole.name


def _open(file: Path, stack: ExitStack) -> BagReader:
    if file.suffix == ".mcap":
        return McapBag.open(file, stack)
    return open_with_rosbags(file, stack)


def _bags_in(folder: Path) -> list[Path]:
    """Return the files of a bag whose recorder was killed before it wrote metadata.yaml."""
    files = sorted(file for file in folder.iterdir() if file.suffix in {".mcap", ".db3"})
    if not files:
        raise FormatError(
            folder, "expected a rosbag2 folder (metadata.yaml, with .mcap or .db3 files), got none"
        )
    return files


class _Files:
    """Several files as one bag."""

    def __init__(self, files: Sequence[BagReader]) -> None:
        self._files = files

    @property
    def channels(self) -> Collection[BagChannel]:
        return list(dict.fromkeys(each for file in self._files for each in file.channels))

    def count(self, channels: Collection[BagChannel]) -> int:
        return sum(file.count(channels) for file in self._files)

    def messages(self, channels: Collection[BagChannel]) -> Iterator[BagMessage]:
        streams = [file.messages(channels) for file in self._files]
        yield from heapq.merge(*streams, key=lambda message: message.at_ns)


class _Metadata:
    """What metadata.yaml says of the files; it has more, and of many versions."""

    def __init__(self, path: Path) -> None:
        root = _child(_tree(path), "rosbag2_bagfile_information")
        names = _child(root, "relative_file_paths")
        if not isinstance(names, YamlList):
            raise FormatError(path, "expected rosbag2's metadata, got something else")
        self.files = [name.text for name in names.items if isinstance(name, Scalar)]
        self.packed = _packing(root, path)
        for name in self.files:
            if Path(name).is_absolute() or ".." in Path(name).parts:
                raise FormatError(path, f"expected files of this folder, got {name!r}")
        if len(set(self.files)) < len(self.files):
            raise FormatError(path, "expected each file once, got one twice")


def _child(node: Node | None, key: str) -> Node | None:
    return node.entries.get(key) if isinstance(node, Mapping) else None


def _packing(root: Node | None, path: Path) -> Literal["", "file", "message"]:
    """Return what of a bag is packed with zstd.

    Raises:
        FormatError: It is packed in another way.
    """
    mode, form = (
        node.text.lower() if isinstance(node := _child(root, key), Scalar) else ""
        for key in ("compression_mode", "compression_format")
    )
    if mode in {"", "none"}:
        return ""
    if form != "zstd":
        raise FormatError(path, f"expected a bag packed with zstd, got {shown(form)}")
    if mode == "file":
        return "file"
    if mode == "message":
        return "message"
    raise FormatError(path, f"expected packed files or messages, got {shown(mode)}")


def _tree(path: Path) -> Node:
    return parse_yaml(read_capped(path, most_bytes=8 * MIB), path)


WRITABLE_BAGS = ".mcap, .bag (ROS 1), or a name without an extension (a rosbag2 folder)"


OpenBag = Callable[[Path, Sequence[BagTopic]], AbstractContextManager[NewBag]]


@contextmanager
def new_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[NewBag]:
    """Write a bag, whole or not at all.

    Args:
        path: Its suffix is the format. A file of that name is replaced at once, when the new one
            is whole; a folder never is.
        topics: All that will be written to.

    Raises:
        FormatError: The name has no known extension.
        OutputError: It cannot be written, or a folder of that name is there; what was there stays.
    """
    write_bag, whole = _form_of(path)
    with (
        output_errors(path),
        whole(path) as temporary,
        write_bag(temporary, topics) as bag,
    ):
        yield bag


def ros_version_of(path: Path) -> RosVersion:
    """Return whose messages a bag of that name holds."""
    return 1 if path.suffix.lower() == ".bag" else 2


def is_bag_name(path: Path) -> bool:
    """Return whether a name is that of a bag, as `new_bag` reads it."""
    return path.suffix.lower() in {".mcap", ".bag", ""}


def _form_of(path: Path) -> tuple[OpenBag, Callable[[Path], AbstractContextManager[Path]]]:
    """Return what writes a bag of that name, and what sees to it that it is whole."""
    if path.suffix.lower() == ".mcap":
        from semmap_log.interop.formats.bags.bag_protocol import mcap_bag

        return mcap_bag, atomic_file
    if path.suffix.lower() == ".bag":
        return ros1_bag, atomic_file
    if not path.suffix:
        from semmap_log.interop.formats.bags.ros2_bag import ros2_bag

        return ros2_bag, atomic_folder
    raise FormatError(path, f"unknown extension for a new bag; expected one of: {WRITABLE_BAGS}.")


def bytes_of(path: Path) -> int:
    """Return how large a bag is: a file, or a folder's files together."""
    files = path.iterdir() if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files)


CALLER = "/semmap_log"
"""Who published it: without a caller, rosbag does not replay a topic as latched."""


@contextmanager
def ros1_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[_Ros1Bag]:
    """Write the file, its chunks packed as lz4; it is closed when the block ends well."""
    import lz4.frame
    from rosbags.rosbag1 import Writer

    path.unlink()  # which `atomic_file` made: rosbags makes its own, and follows no link
    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    # ROS's own roslz4 reads no frames but these ("malformed data to decompress").
    writer.compressor = partial(
        lz4.frame.compress, block_linked=False, content_checksum=True, store_size=False
    )
    with writer:
        yield _Ros1Bag(writer, topics)


class _Ros1Bag:
    ros_version: RosVersion = 1

    def __init__(self, writer: Any, topics: Sequence[BagTopic]) -> None:
        self._writer = writer
        self._connections = {
            topic: writer.add_connection(
                topic.name,
                topic.ros_type,
                typestore=ros_types(1),
                callerid=CALLER,
                latching=int(topic.is_latched),
            )
            for topic in topics
        }

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self.write_encoded(topic, at_ns, encoded(1, message, topic.ros_type))

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        self._writer.write(self._connections[topic], at_ns, data)
