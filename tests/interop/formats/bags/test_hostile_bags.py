"""Bags made to do harm are errors that say what is wrong, in little memory, and come to an end."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from struct import pack

import numpy as np
import pytest
import zstandard

from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_reading import open_bag
from semmap_log.interop.formats.bags.unpacking import FREE_BYTES, MOST_BYTES, most_unpacked, unpack
from semmap_log.interop.formats.ros.ros_types import MessageType, decode_message
from tests.interop.formats.bags.hostile_bags import (
    HOSTILE,
    MIB,
    chunk_of,
    header,
    mcap_of,
    message,
    mutated,
    ros1_bag_of,
    write_database,
    zeros_in_bz2,
    zeros_in_lz4,
    zeros_in_zstd,
)
from tests.interop.formats.bags.test_bag_reading import WRITERS
from tests.interop.formats.bags.test_bag_reading import _day as one_day

MEMORY_BYTES = 1024 * MIB
PEAK_BYTES = 600 * MIB
"""Python with what it imports, and what may be unpacked at once; none of the bombs fits in it."""

CHILD = f"""
import resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_AS, ({MEMORY_BYTES}, {MEMORY_BYTES}))
resource.setrlimit(resource.RLIMIT_CPU, (100, 100))
from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_reading import open_bag
try:
    with open_bag(Path(sys.argv[1])) as bag:
        for message in bag.messages(bag.channels):
            pass
except FormatError as error:
    print(str(error)[:600])
else:
    print("it was read")
with open("/proc/self/status") as status:  # ru_maxrss would be the parent's before the exec
    print(next(line.split()[1] for line in status if line.startswith("VmHWM")))
"""


def _read_in_child(path: Path) -> tuple[str, int]:
    """Return what was said of a bag, and the greatest memory that it took, bytes."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    child = subprocess.run(
        [sys.executable, "-c", CHILD, path], env=environment, capture_output=True, text=True,
        timeout=500, check=False,
    )  # fmt: skip
    assert (0, "") == (child.returncode, child.stderr[-2000:])
    *said, kilobytes = child.stdout.splitlines()
    return "\n".join(said), 1024 * int(kilobytes)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_bag_is_an_error_and_no_more(tmp_path: Path, name: str) -> None:
    """It names the file, and says what was expected."""
    write, expected = HOSTILE[name]
    write(tmp_path / name)

    said, peak = _read_in_child(tmp_path / name)

    assert said.startswith(str(tmp_path / name))
    assert expected in said
    assert peak < PEAK_BYTES


def test_a_large_message_that_is_mostly_zeros_is_read(tmp_path: Path) -> None:
    """A map of a hundred million unknown cells is no bomb."""
    inside = message(5, 100 * 10**6)
    chunk = chunk_of(zstandard.compress(inside), "zstd", len(inside))
    (tmp_path / "x.mcap").write_bytes(mcap_of(chunk))

    with open_bag(tmp_path / "x.mcap") as bag:
        sizes = [len(each.data) for each in bag.messages(bag.channels)]

    assert [4 + 100 * 10**6] == sizes


def test_chunks_that_overlap_a_little_come_in_order(tmp_path: Path) -> None:
    """Within a chunk, too, the times may go back; equal times come as they stand in the file."""
    dice = np.random.default_rng(3)
    times = [(1000 * n + dice.integers(0, 2500, 40)).tolist() for n in range(20)]
    chunks = []
    for each in times:
        inside = b"".join(message(at) for at in each)
        chunks.append(chunk_of(zstandard.compress(inside), "zstd", len(inside), at=min(each)))
    (tmp_path / "x.mcap").write_bytes(mcap_of(*chunks))

    with open_bag(tmp_path / "x.mcap") as bag:
        read = [each.at_ns for each in bag.messages(bag.channels)]

    assert sorted(at for each in times for at in each) == read


def test_a_chunk_that_begins_before_its_index_says(tmp_path: Path) -> None:
    """Its messages would come too late; that is said."""
    early, late = message(5), message(1)
    chunks = [chunk_of(early, "", len(early), at=5), chunk_of(late, "", len(late), at=6)]
    (tmp_path / "x.mcap").write_bytes(mcap_of(*chunks))

    with open_bag(tmp_path / "x.mcap") as bag, pytest.raises(FormatError, match="before its index"):
        list(bag.messages(bag.channels))


@pytest.mark.parametrize(
    ("compression", "data"),
    [("zstd", zeros_in_zstd(MIB)), ("lz4", zeros_in_lz4(MIB)), ("bz2", zeros_in_bz2(MIB)),
     ("", bytes(MIB)), ("none", bytes(MIB)), ("zstd", zeros_in_zstd(MIB, tells_size=False))],
)  # fmt: skip
def test_what_is_packed_is_unpacked_to_the_byte(compression: str, data: bytes) -> None:
    """And what was declared otherwise, or is cut, is an error in words."""
    assert bytes(MIB) == unpack(data, compression) == unpack(data, compression, declared=MIB)
    with pytest.raises(ValueError, match=r"expected 7 unpacked bytes, got (more|1,048,576)"):
        unpack(data, compression, declared=7)
    with pytest.raises(ValueError, match="128 MiB, or 1,000 times"):
        unpack(data, compression, declared=2 * MOST_BYTES)
    if compression not in ("", "none"):
        with pytest.raises(ValueError, match=f"it is no {compression}|unpacked bytes, got"):
            unpack(data[:-3], compression, declared=MIB)


def test_the_limits_of_what_is_unpacked() -> None:
    """128 MiB whatever the ratio; beyond, a thousandfold; never more than 256 MiB."""
    assert [FREE_BYTES, FREE_BYTES, 200_000_000, MOST_BYTES, MOST_BYTES] == [
        most_unpacked(packed) for packed in (0, 100_000, 200_000, 300_000, 2**40)
    ]
    with pytest.raises(ValueError, match="zstd, lz4 or bz2"):
        unpack(b"", "rar")


@pytest.mark.parametrize("version", [1, 2])
def test_lists_of_nothing_are_refused(version: int) -> None:
    """Four bytes could mean four billion of them."""
    definition = "std_msgs/Empty[] them\n" + "=" * 80 + "\nMSG: std_msgs/Empty\n"
    said = MessageType("std_msgs/msg/Bool", version, definition)  # type: ignore[arg-type]

    with pytest.raises(FormatError, match="Bool"):
        decode_message(said, b"\0\1\0\0" + b"\xff\xff\xff\xff")


def test_lists_of_very_many_items_are_refused() -> None:
    """Each would become an object; numbers in an array do not."""
    flags = "Flag[] them\n" + "=" * 80 + "\nMSG: std_msgs/Flag\nbool one\n"
    data = b"\0\1\0\0" + (9_000_000).to_bytes(4, "little") + bytes(9_000_000)

    with pytest.raises(FormatError, match="8,000,000 items"):
        decode_message(MessageType("std_msgs/msg/Flags", 2, flags), data)
    numbers = decode_message(MessageType("std_msgs/msg/Numbers", 2, "uint8[] them"), data)

    assert 9_000_000 == len(numbers.them)


def test_a_type_within_itself_is_refused() -> None:
    """Or it would be looked at for ever."""
    endless = "Tree[] of\n" + "=" * 80 + "\nMSG: std_msgs/Tree\nTree[] of\n"

    with pytest.raises(FormatError, match="is a part of itself"):
        decode_message(MessageType("std_msgs/msg/Trees", 2, endless), b"\0\1\0\0\0\0\0\0")


@pytest.mark.parametrize("name", ["a%20b.db3", "a?b=c.db3", "a#b.db3", "tür\udcff.db3"])
def test_names_that_look_like_a_uri(tmp_path: Path, name: str) -> None:
    """The file is read, and no other."""
    write_database(tmp_path / "plain.db3", "INSERT INTO messages VALUES (1, 1, 5, x'0001000001')")
    (tmp_path / "plain.db3").rename(tmp_path / name)

    with open_bag(tmp_path / name) as bag:
        assert [5] == [each.at_ns for each in bag.messages(bag.channels)]


NO_SENTENCES = ("AssertionError", "MemoryError", "KeyError", "struct.error", "IndexError", ": '")


@pytest.mark.parametrize(
    "kind", ["rosbags.bag", "sqlite", "ros2.mcap", "lz4.mcap", "no_chunks.mcap", "no_index.mcap"]
)
def test_any_damage_is_a_bag_or_an_error_in_words(tmp_path: Path, kind: str) -> None:
    """Of good bags that were changed at random; the same changes each time."""
    version, write = WRITERS[kind]
    write(tmp_path / kind, one_day(version, 6))
    (good,) = tmp_path.rglob("*.db3") if kind == "sqlite" else [tmp_path / kind]
    dice, data, refused = random.Random(16), good.read_bytes(), 0
    bad = tmp_path / f"bad{good.suffix}"

    for _ in range(120):
        bad.write_bytes(mutated(data, dice))
        try:
            with open_bag(bad) as bag:
                for each in bag.messages(bag.channels):
                    with suppress(FormatError):
                        decode_message(each.channel.message_type, each.data)
        except FormatError as error:
            refused += 1
            assert str(error).startswith(str(bad))
            assert not [word for word in NO_SENTENCES if word in str(error)], error

    assert refused > 40


def test_a_library_that_only_asserts_is_put_into_words(tmp_path: Path) -> None:
    """An index whose entry tells another time than the message does: rosbags says nothing."""
    inside = header(op=b"\2", conn=pack("<I", 0), time=pack("<II", 7, 7)) + pack("<I", 1) + b"\1"
    (tmp_path / "x.bag").write_bytes(ros1_bag_of("none", inside))

    with open_bag(tmp_path / "x.bag") as bag, pytest.raises(FormatError) as caught:
        list(bag.messages(bag.channels))

    assert "x.bag" in str(caught.value)
