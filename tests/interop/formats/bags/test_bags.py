"""Bags for ROS's players: whole or not at all, and the same in every reader."""

from __future__ import annotations

import errno
import subprocess
from collections import Counter
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import StoragePlugin, Writer

from semmap_log.errors import FormatError, OutputError
from semmap_log.interop.formats.bags.bag_reading import new_bag
from semmap_log.interop.formats.ros.door_messages import GRIDS, UPDATES
from semmap_log.interop.formats.ros.ros_types import ros_types
from tests.interop.formats.bags.played import played
from tests.interop.formats.ros.test_grid_messages import BAGS, GEOMETRY, START, restless, write

LZ4_MAGIC = bytes.fromhex("04224d18")


def _bytes_of(path: Path) -> dict[str, str]:
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    return {file.name: sha256(file.read_bytes()).hexdigest() for file in files}


@pytest.mark.parametrize("name", BAGS)
def test_the_same_messages_give_the_same_bytes(name: str, tmp_path: Path) -> None:
    """Nothing of the time, the place or the process is in the file."""
    for folder in ("first", "second"):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder / name, restless(1))

    assert _bytes_of(tmp_path / "first" / name) == _bytes_of(tmp_path / "second" / name)


@pytest.mark.parametrize("name", BAGS)
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(errno.ENOSPC, "No space left")])
def test_what_is_broken_off_leaves_nothing(name: str, error: Any, tmp_path: Path) -> None:
    """After Ctrl-C or on a full disk neither the bag nor a temporary file is there."""
    expected = KeyboardInterrupt if error is KeyboardInterrupt else OutputError

    with pytest.raises(expected), new_bag(tmp_path / name, [GRIDS]):
        raise error

    assert [] == list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["x.mcap", "x.bag"])
def test_what_is_broken_off_leaves_the_old_file(name: str, tmp_path: Path) -> None:
    """A file is replaced when the new one is whole, not before."""
    (tmp_path / name).write_bytes(b"old")

    with pytest.raises(KeyboardInterrupt), new_bag(tmp_path / name, [GRIDS]):
        raise KeyboardInterrupt

    assert b"old" == (tmp_path / name).read_bytes()
    write(tmp_path / name, restless(1))
    assert len(played(tmp_path / name)) > 20
    assert [name] == [path.name for path in tmp_path.iterdir()]


def test_a_folder_is_never_replaced(tmp_path: Path) -> None:
    """What is in a folder of that name stays; the message says what to do."""
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "photo").write_bytes(b"dear")

    with pytest.raises(OutputError, match="is there already; remove it, or choose another name"):
        write(tmp_path / "x", restless(1))

    assert b"dear" == (tmp_path / "x" / "photo").read_bytes()


def test_a_name_that_tells_no_bag_is_refused(tmp_path: Path) -> None:
    """The message lists the names that do."""
    with (
        pytest.raises(FormatError, match=r"one of: \.mcap, \.bag \(ROS 1\)"),
        new_bag(tmp_path / "x.zip", [GRIDS]),
    ):
        pass


def test_the_mcap_library_reads_what_rosbags_reads(tmp_path: Path) -> None:
    """Closed, every CRC right, indexed in chunks, profile ros2."""
    write(tmp_path / "x.mcap", restless(1))

    with (tmp_path / "x.mcap").open("rb") as file:
        records = list(StreamReader(file, validate_crcs=True).records)
        file.seek(0)
        reader = make_reader(file, validate_crcs=True)
        messages = list(reader.iter_messages())
        summary = reader.get_summary()
    header, data_end = records[0], next(r for r in records if type(r).__name__ == "DataEnd")
    assert ("ros2", True) == (header.profile, data_end.data_section_crc != 0)
    assert summary.chunk_indexes[0].message_index_offsets.keys() == {1, 2}
    assert "zstd" == summary.chunk_indexes[0].compression
    by_rosbags = played(tmp_path / "x.mcap")
    assert [(each.at_ns, each.topic) for each in by_rosbags] == [
        (message.log_time, channel.topic) for _, channel, message in messages
    ]
    for topic in (GRIDS.name, UPDATES.name):
        numbers = [message.sequence for _, channel, message in messages if channel.topic == topic]
        assert list(range(len(numbers))) == numbers
    assert messages[0][2].publish_time == START


@pytest.mark.parametrize("name", ["x.mcap", "x"])
def test_who_comes_late_gets_the_last_grid(name: str, tmp_path: Path) -> None:
    """Players offer grids as transient_local, and updates as volatile."""
    write(tmp_path / name, restless(1))

    with AnyReader([tmp_path / name]) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles[0].durability for c in reader.connections}

    assert {
        GRIDS.name: QosDurability.TRANSIENT_LOCAL,
        UPDATES.name: QosDurability.VOLATILE,
    } == offered


def test_metadata_yaml_says_what_rosbags_would_say(tmp_path: Path) -> None:
    """Of the same messages, written by that library, it is the same but for the file's name."""
    write(tmp_path / "x", restless(1))
    with (
        AnyReader([tmp_path / "x"]) as reader,
        Writer(tmp_path / "y", version=9, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        copies = {
            c.topic: writer.add_connection(
                c.topic,
                c.msgtype,
                typestore=ros_types(2),
                offered_qos_profiles=c.ext.offered_qos_profiles,
            )
            for c in reader.connections
        }
        for connection, at_ns, data in reader.messages():
            writer.write(copies[connection.topic], at_ns, data)

    theirs = (tmp_path / "y" / "metadata.yaml").read_text().replace("y.mcap", "x_0.mcap")
    assert yaml.safe_load(theirs) == yaml.safe_load((tmp_path / "x" / "metadata.yaml").read_text())


def test_ros_1_latches_the_grids(tmp_path: Path) -> None:
    """The connections of a ROS 1 bag say so, and have a caller, without which rosbag ignores it."""
    write(tmp_path / "x.bag", restless(1))

    with AnyReader([tmp_path / "x.bag"]) as reader:
        said = {c.topic: (c.ext.latching, c.ext.callerid) for c in reader.connections}

    assert {GRIDS.name: (1, "/semmap_log"), UPDATES.name: (0, "/semmap_log")} == said


def test_ros_1_can_unpack_the_chunks(tmp_path: Path) -> None:
    """roslz4 takes version 1, independent blocks, a checksum and no size (lz4s.c)."""
    write(tmp_path / "x.bag", restless(1))

    data = (tmp_path / "x.bag").read_bytes()
    frames = [data[at + 4] for at in range(len(data)) if data.startswith(LZ4_MAGIC, at)]
    assert frames
    assert {0b01_1_0_0_1_00} == set(frames)


@pytest.mark.slow
def test_ros_1s_own_library_reads_every_message(tmp_path: Path) -> None:
    """As `rosbag play` would: where ROS 1's python is installed."""
    python = Path("/usr/bin/python3")
    has_rosbag = subprocess.run([python, "-c", "import rosbag"], capture_output=True, check=False)
    if has_rosbag.returncode:
        pytest.skip("ROS 1's rosbag is not installed (Debian: python3-rosbag)")
    counts = write(tmp_path / "x.bag", restless(1))
    code = (
        "import rosbag, sys\nfor topic, *_ in rosbag.Bag(sys.argv[1]).read_messages(): print(topic)"
    )

    done = subprocess.run([python, "-c", code, tmp_path / "x.bag"], capture_output=True, text=True,
                          check=False)  # fmt: skip

    assert (0, "") == (done.returncode, done.stderr)
    assert counts == Counter(done.stdout.split())


def test_ros_knows_the_update_by_its_digest() -> None:
    """The MD5 by which noetic's nodes tell whether map_msgs/OccupancyGridUpdate is theirs."""
    digest = ros_types(1).generate_msgdef(UPDATES.ros_type)[1]

    assert "b295be292b335c34718bd939deebe1c9" == digest


@pytest.mark.viewer
def test_rerun_draws_the_grids_as_they_are(tmp_path: Path) -> None:
    """Rerun's own loader makes of each grid a GridMap in its place, the top row first."""
    pytest.importorskip("rerun")
    from rerun.chunk import McapReader

    write(tmp_path / "x.mcap", restless(1), every_s=0)

    rows = [
        dict(zip(batch.schema.names, row, strict=True))
        for chunk in McapReader(tmp_path / "x.mcap").stream()
        if chunk.entity_path == GRIDS.name and not chunk.is_static
        for batch in [chunk.to_record_batch()]
        for row in zip(*(column.to_pylist() for column in batch.columns), strict=True)
    ]
    grids = [each for each in played(tmp_path / "x.mcap") if each.topic == GRIDS.name]
    assert len(grids) == len(rows) > 20
    for each, row in zip(grids, rows, strict=True):
        cells = np.frombuffer(bytes(row["GridMap:data"][0]), np.int8)
        np.testing.assert_array_equal(np.flipud(each.cells), cells.reshape(GEOMETRY.shape))
    np.testing.assert_allclose([-1.0, 2.0, 0.0], rows[0]["GridMap:translation"][0])
