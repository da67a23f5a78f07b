"""A new bag that ROS's players open: `.mcap`, `.bag` (ROS 1) or a folder (rosbag2).

It is there whole or not at all: written under a temporary name, synced, then named. The same
messages give the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from semmap_log.core.io.disk import output_errors, whole_file, whole_folder
from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic, NewBag
from semmap_log.interop.formats.ros.ros_types import RosVersion

WRITABLE_BAGS = ".mcap, .bag (ROS 1), or a name without an extension (a rosbag2 folder)"


OpenBag = Callable[[Path, Sequence[BagTopic]], AbstractContextManager[NewBag]]


@contextmanager
def new_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[NewBag]:
    """Write a bag, whole or not at all.

    Args:
        path: Its suffix tells the form. A file of that name is replaced at once, when the new one
            is whole; a folder never is.
        topics: All that will be written to.

    Raises:
        FormatError: The name tells no form.
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


def tells_a_bag(path: Path) -> bool:
    """Tell whether a name is that of a bag, as `new_bag` reads it."""
    return path.suffix.lower() in {".mcap", ".bag", ""}


def _form_of(path: Path) -> tuple[OpenBag, Callable[[Path], AbstractContextManager[Path]]]:
    """Return what writes a bag of that name, and what sees to it that it is whole."""
    if path.suffix.lower() == ".mcap":
        from semmap_log.interop.formats.bags.mcap_bag import mcap_bag

        return mcap_bag, whole_file
    if path.suffix.lower() == ".bag":
        from semmap_log.interop.formats.bags.ros1_bag import ros1_bag

        return ros1_bag, whole_file
    if not path.suffix:
        from semmap_log.interop.formats.bags.ros2_bag import ros2_bag

        return ros2_bag, whole_folder
    raise FormatError(path, f"its name tells no bag that can be written; known: {WRITABLE_BAGS}.")


def bytes_of(path: Path) -> int:
    """Return how large a bag is: a file, or a folder's files together."""
    files = path.iterdir() if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files)
