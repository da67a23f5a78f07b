"""Bags of others: each form gives the same messages; what is damaged is told, never passed over."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from struct import unpack_from
from typing import Any

import pytest
import yaml
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType

import semmap_log as sl
from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import BagMessage
from semmap_log.interop.formats.bags.bag_reading import is_bag, open_bag
from semmap_log.interop.formats.ros.ros_types import MessageType, RosVersion, decode_message
from tests.interop.formats.bags.bags_of_others import (
    Said,
    write_mcap,
    write_ros1,
    write_ros2,
    write_with_rosbag,
)
from tests.interop.topics.robots import START, Robot, S


def _day(version: RosVersion, count: int = 60) -> list[Said]:
    """Door maps, door states and words, two seconds apart."""
    robot = Robot(version)
    said = []
    for n in range(count):
        name, data = [
            robot.door_map([{"door_id": 1, "pos_x": float(n)}]),
            robot.door_state(f"door{n}", n % 5),
            robot.said("String", "hello" * n),
        ][n % 3]
        said.append(Said(f"/{name.rpartition('/')[2]}", name, data, START + 2 * n * S))
    return said


WRITERS: dict[str, tuple[RosVersion, Callable[[Path, Sequence[Said]], None]]] = {
    "rosbag.bag": (1, write_with_rosbag),
    "bz2.bag": (1, lambda path, said: write_with_rosbag(path, said, "bz2")),
    "lz4.bag": (1, lambda path, said: write_with_rosbag(path, said, "lz4")),
    "rosbags.bag": (1, write_ros1),
    "folder": (2, write_ros2),
    "sqlite": (2, lambda path, said: write_ros2(path, said, "sqlite3")),
    "file_zstd": (2, lambda path, said: write_ros2(path, said, "sqlite3", "file")),
    "message_zstd": (2, lambda path, said: write_ros2(path, said, "sqlite3", "message")),
    "ros2.mcap": (2, write_mcap),
    "ros1.mcap": (1, lambda path, said: write_mcap(path, said, 1)),
    "no_profile.mcap": (2, lambda path, said: write_mcap(path, said, profile="")),
    "lz4.mcap": (2, lambda path, said: write_mcap(path, said, compression=CompressionType.LZ4)),
    "no_chunks.mcap": (2, lambda path, said: write_mcap(path, said, use_chunking=False)),
    "no_index.mcap": (2, lambda path, said: write_mcap(path, said, index_types=IndexType.NONE)),
    "no_message_index.mcap": (
        2,
        lambda path, said: write_mcap(
            path, said, index_types=IndexType.CHUNK | IndexType.METADATA
        ),
    ),
    **{
        f"no_{'_'.join(left_out)}.mcap": (
            2,
            lambda path, said, left_out=left_out: write_mcap(
                path, said, **{f"repeat_{what}": False for what in left_out}
            ),
        )
        for left_out in (["channels"], ["schemas"], ["channels", "schemas"])
    },
    "no_names_at_all.mcap": (
        2,
        lambda path, said: write_mcap(
            path, said, index_types=IndexType.CHUNK, use_statistics=False, repeat_channels=False,
            repeat_schemas=False,
        ),
    ),
    "no_summary.mcap": (
        2,
        lambda path, said: write_mcap(
            path, said, index_types=IndexType.NONE, use_statistics=False,
            use_summary_offsets=False, repeat_channels=False, repeat_schemas=False,
        ),
    ),
}  # fmt: skip


def _read(path: Path, *topics: str) -> list[BagMessage]:
    with open_bag(path) as bag:
        chosen = [each for each in bag.channels if not topics or each.topic in topics]
        return list(bag.messages(chosen))


def _as_said(messages: Sequence[BagMessage]) -> list[Said]:
    return [Said(m.channel.topic, m.channel.message_type.name, m.data, m.at_ns) for m in messages]


@pytest.mark.parametrize("name", WRITERS)
def test_every_form_gives_the_same_messages(name: str, tmp_path: Path) -> None:
    """With their topics, types, bytes and times; and they can be decoded by what the bag says."""
    version, write = WRITERS[name]
    said = _day(version)
    write(tmp_path / name, said)

    read = _read(tmp_path / name)

    assert is_bag(tmp_path / name)
    assert said == _as_said(read)
    decoded = [decode_message(each.channel.message_type, each.data) for each in read]
    assert [float(n) for n in range(0, 60, 3)] == [each.door_db[0].pos_x for each in decoded[::3]]
    assert [f"door{n}" for n in range(1, 60, 3)] == [each.door_name for each in decoded[1::3]]


@pytest.mark.parametrize("name", ["rosbag.bag", "sqlite", "ros2.mcap", "no_chunks.mcap"])
def test_only_the_topics_that_are_asked_for_are_read(name: str, tmp_path: Path) -> None:
    """And the bag says how many there are of them."""
    version, write = WRITERS[name]
    write(tmp_path / name, _day(version))

    read = _read(tmp_path / name, "/DoorState")

    assert {"/DoorState"} == {each.channel.topic for each in read}
    with open_bag(tmp_path / name) as bag:
        assert len(read) == bag.count({each.channel for each in read})


@pytest.mark.parametrize("version", [1, 2])
def test_a_type_is_read_by_the_bags_own_definition(version: Any, tmp_path: Path) -> None:
    """A robot's DoorState that has another field before ours is read as it was written."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    name = "rmf_door_msgs/msg/DoorState"
    types = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_JAZZY)
    types.register(get_types_from_msg("uint8 colour\nstring door_name", name))
    encode = types.serialize_ros1 if version == 1 else types.serialize_cdr
    data = bytes(encode(types.types[name](colour=7, door_name="front"), name))
    text, _ = types.generate_msgdef(name, ros_version=version)

    message = decode_message(MessageType(name, version, text), data)

    assert (7, "front") == (message.colour, message.door_name)


def test_a_bag_without_definitions_is_read_by_ours(tmp_path: Path) -> None:
    """rosbag2 wrote none into .db3 before Iron."""
    said = _day(2)
    write_ros2(tmp_path / "bag", said, "sqlite3")
    (database,) = (tmp_path / "bag").glob("*.db3")
    with sqlite3.connect(database) as connection:
        connection.execute("DELETE FROM message_definitions")

    read = _read(tmp_path / "bag")

    assert {""} == {each.channel.message_type.definition for each in read}
    assert 1.0 != decode_message(read[0].channel.message_type, read[0].data).door_db[0].pos_x


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
@pytest.mark.parametrize("packed", ["", "file"])
@pytest.mark.parametrize("folder", ["bag", "as_it_was_called"])
def test_files_whose_names_begin_with_the_folders_are_found(
    tmp_path: Path, storage: Any, packed: Any, folder: str
) -> None:
    """As rosbag2 wrote them up to version 3 of its metadata, and of packed bags in version 4."""
    said = _day(2)
    write_ros2(tmp_path / "bag", said, storage, packed)
    metadata = tmp_path / "bag" / "metadata.yaml"
    known = yaml.safe_load(metadata.read_text())
    information = known["rosbag2_bagfile_information"]
    information["version"] = 4 if packed else 3
    information["relative_file_paths"] = [
        f"{folder}/{name}" for name in information["relative_file_paths"]
    ]
    metadata.write_text(yaml.safe_dump(known))

    assert said == _as_said(_read(tmp_path / "bag"))


@pytest.mark.parametrize("name", ["bag.bag", "bag", "bag.mcap"])
def test_a_topic_without_a_slash_is_the_one_with_it(tmp_path: Path, name: str) -> None:
    """To a node without a namespace they are one."""
    said = [replace(each, topic=each.topic.strip("/")) for each in _day(1 if "." in name else 2)]
    write: Any = {"bag.bag": write_ros1, "bag": write_ros2}.get(name)
    if write is None:
        write_mcap(tmp_path / name, said, 1)
    else:
        write(tmp_path / name, said)

    assert {"/DoorMap", "/DoorState", "/String"} == {
        each.channel.topic for each in _read(tmp_path / name)
    }


def test_a_folder_whose_metadata_tells_another_qos_is_read_whole(tmp_path: Path) -> None:
    """rosbags itself passes over such a file's messages in silence."""
    said = _day(2)
    write_ros2(tmp_path / "bag", said)
    _tell_another_qos(tmp_path / "bag" / "metadata.yaml")

    assert said == _as_said(_read(tmp_path / "bag"))


@pytest.mark.parametrize("packed", ["message", "file"])
def test_a_packed_folder_whose_metadata_tells_another_qos_is_read_whole(
    tmp_path: Path, packed: Any
) -> None:
    """Of a compressed folder, too, each file is read by itself."""
    said = _day(2)
    write_ros2(tmp_path / "bag", said, "sqlite3", packed)
    _tell_another_qos(tmp_path / "bag" / "metadata.yaml")

    assert said == _as_said(_read(tmp_path / "bag"))


def _tell_another_qos(metadata: Path) -> None:
    known = yaml.safe_load(metadata.read_text())
    for each in known["rosbag2_bagfile_information"]["topics_with_message_count"]:
        each["topic_metadata"]["offered_qos_profiles"] = [
            {
                "history": "keep_all",
                "depth": 0,
                "reliability": "best_effort",
                "durability": "volatile",
                "deadline": {"sec": 0, "nsec": 0},
                "lifespan": {"sec": 0, "nsec": 0},
                "liveliness": "automatic",
                "liveliness_lease_duration": {"sec": 0, "nsec": 0},
                "avoid_ros_namespace_conventions": False,
            }
        ]
    metadata.write_text(yaml.safe_dump(known))


def test_a_folder_without_metadata_is_read_too(tmp_path: Path) -> None:
    """Its recorder was killed behind a file that is whole."""
    said = _day(2)
    write_ros2(tmp_path / "bag", said)
    (tmp_path / "bag" / "metadata.yaml").unlink()

    assert said == _as_said(_read(tmp_path / "bag"))


def test_files_that_overlap_are_read_in_the_order_of_their_times(tmp_path: Path) -> None:
    """A folder's second file may begin before the first one ends."""
    said = _day(2, 20)
    (tmp_path / "bag").mkdir()
    write_mcap(tmp_path / "bag" / "bag_0.mcap", [*said[:10:2], *said[10:]])
    write_mcap(tmp_path / "bag" / "bag_1.mcap", said[1:10:2])

    assert said == _as_said(_read(tmp_path / "bag"))


def test_a_message_that_was_flipped_on_the_disk_is_not_read(tmp_path: Path) -> None:
    """What could still be decoded, and says something else, is told by the chunk's checksum."""
    write_mcap(tmp_path / "x.mcap", _day(2), compression=CompressionType.NONE)
    data = (tmp_path / "x.mcap").read_bytes()
    (tmp_path / "x.mcap").write_bytes(data.replace(b"hellohello", b"jellohello", 1))

    with pytest.raises(FormatError, match=r"x\.mcap: damaged"):
        _read(tmp_path / "x.mcap")


def test_a_file_without_an_index_comes_in_the_order_of_its_times(tmp_path: Path) -> None:
    """As far as it is about in order; times that go back and forth further are told."""
    said = _day(2, 9)
    swapped = [said[1], said[0], *said[2:]]
    write_mcap(tmp_path / "x.mcap", swapped, use_chunking=False)
    big = Robot(2).said("String", "x" * 10**6)
    far = [Said("/s", *big, START + n * S) for n in (*range(1, 80), 0)]
    write_mcap(tmp_path / "far.mcap", far, use_chunking=False)

    assert said == _as_said(_read(tmp_path / "x.mcap"))
    with pytest.raises(FormatError, match=r"go back and forth too far.*mcap sort"):
        _read(tmp_path / "far.mcap")


@pytest.mark.parametrize("name", ["ros2.mcap", "no_chunks.mcap"])
def test_an_mcap_whose_end_was_never_written_is_told(name: str, tmp_path: Path) -> None:
    """Other readers take such a file for empty, or for shorter than it is."""
    WRITERS[name][1](tmp_path / "x.mcap", _day(2))
    data = (tmp_path / "x.mcap").read_bytes()
    (tmp_path / "x.mcap").write_bytes(data[: len(data) // 2])

    with pytest.raises(FormatError, match=r"its end was never written .*mcap recover"):
        _read(tmp_path / "x.mcap")


def _summary_at(data: bytes) -> int:
    """Return where an MCAP's summary begins."""
    return int(unpack_from("<Q", data, len(data) - 28)[0])


def test_a_damaged_summary_is_told(tmp_path: Path) -> None:
    """Wherever a bit of it is another; by some of them other readers pass over half of the file."""
    write_mcap(tmp_path / "x.mcap", _day(2))
    data = (tmp_path / "x.mcap").read_bytes()

    for at in range(_summary_at(data), len(data) - 12, 23):
        hurt = bytearray(data)
        hurt[at] ^= 4
        (tmp_path / "hurt.mcap").write_bytes(hurt)
        with pytest.raises(FormatError):
            _read(tmp_path / "hurt.mcap")


@pytest.mark.parametrize("use_chunking", [True, False])
def test_an_mcap_that_has_fewer_messages_than_it_says_is_told(
    tmp_path: Path, use_chunking: bool
) -> None:
    """By its statistics, which count each channel's."""
    write_mcap(tmp_path / "x.mcap", _day(2), enable_crcs=False, use_chunking=use_chunking)
    data = bytearray((tmp_path / "x.mcap").read_bytes())
    at = _summary_at(data)
    while data[at] != Opcode.STATISTICS:
        at += 9 + unpack_from("<Q", data, at + 1)[0]
    behind = at + 9 + unpack_from("<Q", data, at + 1)[0]
    data[behind - 8] += 1  # it ends with a channel's number and count

    (tmp_path / "x.mcap").write_bytes(data)

    with pytest.raises(FormatError, match="itself says, got 60"):
        _read(tmp_path / "x.mcap")


def test_a_db3_that_is_cut_is_told(tmp_path: Path) -> None:
    """SQLite itself reads zeros where the last page is cut."""
    write_ros2(tmp_path / "bag", _day(2), "sqlite3")
    (database,) = (tmp_path / "bag").glob("*.db3")
    database.write_bytes(database.read_bytes()[:-1])

    with pytest.raises(FormatError, match=r"its end is lost: expected [0-9,]+ bytes, got [0-9,]+"):
        _read(tmp_path / "bag")


def test_a_db3_that_was_not_closed_is_told(tmp_path: Path) -> None:
    """Its latest messages are in a file beside it, which nobody would have read."""
    write_ros2(tmp_path / "bag", _day(2), "sqlite3")
    (database,) = (tmp_path / "bag").glob("*.db3")
    database.with_name(f"{database.name}-wal").write_bytes(b"some of it")

    with pytest.raises(FormatError, match=r"closed.*pragma wal_checkpoint"):
        _read(tmp_path / "bag")


def test_a_log_of_ours_is_no_bag(tmp_path: Path) -> None:
    """Neither its folder, nor a segment that is closed, nor one that is being written."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="front")
        open_segment = (tmp_path / "log" / "log_000000.mcap").read_bytes()
    (tmp_path / "open.mcap").write_bytes(open_segment)

    for path in (tmp_path / "log", tmp_path / "log" / "log_000000.mcap", tmp_path / "open.mcap"):
        with pytest.raises(FormatError, match=r"semmap-log.*events\.jsonl"):
            _read(path)


@pytest.mark.parametrize("name", ["x.bag", "x.mcap", "x.db3", "x.zip"])
def test_what_is_no_bag_is_told(name: str, tmp_path: Path) -> None:
    """Nothing, an empty file, another program's file, a folder without files."""
    with pytest.raises(FormatError, match=r"x\.[a-z0-9]+: "):
        _read(tmp_path / name)
    for content in (b"", b"PK\x03\x04 a zip file"):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FormatError, match=r"x\.[a-z0-9]+: "):
            _read(tmp_path / name)
    (tmp_path / "empty").mkdir()
    with pytest.raises(FormatError, match="expected a rosbag2 folder"):
        _read(tmp_path / "empty")


def test_metadata_may_not_name_files_elsewhere(tmp_path: Path) -> None:
    """A folder of others reaches no files but its own."""
    write_ros2(tmp_path / "bag", _day(2))
    path = tmp_path / "bag" / "metadata.yaml"
    path.write_text(path.read_text().replace("bag.mcap", "../secret.mcap"))

    with pytest.raises(FormatError, match="expected files of this folder"):
        _read(tmp_path / "bag")


@pytest.mark.parametrize("name", ["rosbags.bag", "ros2.mcap", "no_chunks.mcap", "sqlite"])
def test_damaged_bags_end_in_our_error_or_in_messages(name: str, tmp_path: Path) -> None:
    """Cut and flipped at many places: nothing is read that was not written."""
    version, write = WRITERS[name]
    said = _day(version, 12)
    write(tmp_path / name, said)
    (path,) = [*(tmp_path / name).glob("*.db3"), *([tmp_path / name] if "." in name else [])]
    data = path.read_bytes()

    for at in range(0, len(data), max(1, len(data) // 60)):
        path.write_bytes(data[:at])
        assert set(_as_said(_readable(tmp_path / name))) <= set(said)
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        for each in _readable(tmp_path / name):
            assert isinstance(each.data, bytes)


def _readable(path: Path) -> list[BagMessage]:
    read = []
    try:
        with open_bag(path) as bag:
            for message in bag.messages(bag.channels):
                read.append(message)  # noqa: PERF402  what came before the error counts
    except FormatError:
        pass
    return read
