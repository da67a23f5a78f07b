"""What rosbag2 expects of a file of messages, and of the folder that it lies in."""

from __future__ import annotations

PROFILE = "ros2"
LIBRARY = "semmap-log"
BAG_METADATA_NAME = "metadata.yaml"
VOLATILE, TRANSIENT_LOCAL = "volatile", "transient_local"


def offered_qos(durability: str) -> str:
    """Return a channel's QoS as rosbag2 writes it, one block for all topics.

    In words, as version 9 has it: it takes a number for an unknown policy (rosbag2_storage/qos.cpp)
    and would play nothing. rosbags drops, in silence, a file whose channel and metadata.yaml differ
    here: both are written from this text.
    """
    infinite = "{sec: 9223372036, nsec: 854775807}"
    return (
        f"- {{history: keep_last, depth: 10, reliability: reliable, durability: {durability}, "
        f"deadline: {infinite}, lifespan: {infinite}, liveliness: automatic, "
        f"liveliness_lease_duration: {infinite}, avoid_ros_namespace_conventions: false}}"
    )
