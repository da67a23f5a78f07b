"""Bags as other programs write them, all of the same messages."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from semmap_log.interop.formats.ros.ros_types import RosVersion, ros_types, short_name

DEBIAN_PYTHON = Path("/usr/bin/python3")


@dataclass(frozen=True)
class Said:
    """A message of a bag."""

    topic: str
    ros_type: str
    data: bytes
    at_ns: int


def definition_of(ros_type: str, version: RosVersion) -> tuple[str, str]:
    """Return a type's text and digest, of ours."""
    text, digest = ros_types(version).generate_msgdef(ros_type, ros_version=version)
    return str(text), str(digest)


def write_with_rosbag(path: Path, said: Sequence[Said], compression: str = "none") -> None:
    """Write a `.bag` with ROS 1's own library, or skip the test where that is not installed."""
    try:
        has_rosbag = subprocess.run(
            [DEBIAN_PYTHON, "-c", "import rosbag"], capture_output=True, check=False
        ).returncode
    except OSError:
        has_rosbag = 1
    if has_rosbag:
        pytest.skip("ROS 1's rosbag is not installed (Debian: python3-rosbag)")
    messages = [
        [each.topic, short_name(each.ros_type), each.data.hex(),
         *definition_of(each.ros_type, 1), each.at_ns]
        for each in said
    ]  # fmt: skip
    script = Path(__file__).with_name("write_with_rosbag.py")
    subprocess.run(
        [DEBIAN_PYTHON, script, path, compression],
        input=json.dumps(messages).encode(), check=True,
    )  # fmt: skip


def write_ros1(path: Path, said: Sequence[Said]) -> None:
    """Write a `.bag` with rosbags."""
    with Writer1(path) as writer:
        connections = {}
        for each in said:
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(
                    each.topic, each.ros_type, typestore=ros_types(1)
                )
            writer.write(connections[each.topic], each.at_ns, each.data)


def write_ros2(
    path: Path,
    said: Sequence[Said],
    storage: Literal["mcap", "sqlite3"] = "mcap",
    compression: Literal["", "file", "message", "storage"] = "",
) -> None:
    """Write a rosbag2 folder with rosbags."""
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compression:
        mode = CompressionMode[compression.upper()]
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for each in said:
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(
                    each.topic, each.ros_type, typestore=ros_types(2)
                )
            writer.write(connections[each.topic], each.at_ns, each.data)


def write_mcap(path: Path, said: Sequence[Said], version: RosVersion = 2, **options: Any) -> None:
    """Write an MCAP file with its own library; the options are the writer's."""
    from mcap.writer import Writer as McapWriter

    profile, encodings = options.pop("profile", f"ros{version}"), {1: "ros1", 2: "cdr"}
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=2000, **options)
        writer.start(profile=profile)
        channels: dict[str, int] = {}
        for each in said:
            if each.topic not in channels:
                text = definition_of(each.ros_type, version)[0].encode()
                name = short_name(each.ros_type) if version == 1 else each.ros_type
                schema = writer.register_schema(name, f"ros{version}msg", text)
                channels[each.topic] = writer.register_channel(
                    each.topic, encodings[version], schema
                )
            writer.add_message(channels[each.topic], each.at_ns, each.data, each.at_ns)
        writer.finish()
