"""A folder of rosbag2: its files one after the other, whatever metadata.yaml has forgotten."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Literal

from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import BagChannel, BagMessage, BagReader
from semmap_log.interop.formats.bags.mcap_reading import McapBag
from semmap_log.interop.formats.bags.packed_bags import PackedMessages, unpacked_files
from semmap_log.interop.formats.bags.rosbags_reading import open_with_rosbags
from semmap_log.interop.formats.parsing.foreign_file import MIB, read_capped
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.formats.parsing.strict_yaml import Mapping, Node, Scalar, parse_yaml
from semmap_log.interop.formats.parsing.strict_yaml import Sequence as YamlList
from semmap_log.store.form import BAG_METADATA_NAME


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
