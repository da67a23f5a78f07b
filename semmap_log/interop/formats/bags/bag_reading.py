"""Bags that others wrote: `.bag` (ROS 1), a rosbag2 folder or `.db3`, `.mcap` of either ROS.

Their messages come in the order of their times, in flat memory, with what the bag itself says of
their types. What readers otherwise take for empty in silence (no index, an end that was never
written) is read, or is an error that says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import BagReader

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
    """Tell whether a name, or a folder, is that of a bag."""
    return path.suffix.lower() in _FILES or path.is_dir()


def files_of(path: Path) -> list[Path]:
    """Return the files that a bag is made of, in their order."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.is_file())


_FILES = frozenset({".bag", ".mcap", ".db3"})


def _opened(path: Path, stack: ExitStack) -> BagReader:
    if path.is_dir():
        from semmap_log.interop.formats.bags.bag_folder import open_folder

        return open_folder(path, stack)
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        from semmap_log.interop.formats.bags.mcap_reading import McapBag

        return McapBag.open(path, stack)
    if suffix in _FILES:
        from semmap_log.interop.formats.bags.rosbags_reading import open_with_rosbags

        return open_with_rosbags(path, stack)
    raise FormatError(path, f"its name tells no bag; known are {READABLE_BAGS}")
