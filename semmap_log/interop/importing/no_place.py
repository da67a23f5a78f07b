"""Why no scan of a bag has a place on the map, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from semmap_log.interop.formats.bags.bag_reading import open_bag
from semmap_log.interop.topics.lasers.lasers import Lasers
from semmap_log.interop.topics.topic_problems import TopicProblems
from semmap_log.interop.topics.topic_rules import ONLY_TYPES, ReadPose, RosMapping


def why_no_place(path: Path, lasers: Lasers, mapping: RosMapping, complaints: TopicProblems) -> str:
    """Return why no scan of a bag has a place, and what to do.

    Args:
        path: The bag.
        lasers: After all of it was read.
        mapping: How it was read.
        complaints: About its messages.
    """
    scans = sum(each.received for each in lasers.counts.values())
    why = "; ".join(f"{topic}: {text}" for topic, text in lasers.why_not.items())
    if not why:
        return f"none of its {scans:,} scans can be used: {'; '.join(complaints.lines())}"
    told = f"none of its {scans:,} scans has a place in the frame {mapping.map_frame} ({why})."
    return " ".join((told, *_what_to_do(path, lasers, mapping)))


def _what_to_do(path: Path, lasers: Lasers, mapping: RosMapping) -> Iterator[str]:
    yield (
        f"TF has to lead from {mapping.map_frame} to the laser: record /tf and /tf_static while "
        "the robot localises (amcl, slam_toolbox), or play the bag through it and record that."
    )
    if all(_is_alone(topic, top, lasers) for topic, top in lasers.tops.items()):
        return
    asked = {rule.pose_topic for rule in mapping.scan_rules()} - {""}
    if asked:
        yield (
            f"Or TF from the robot ({mapping.robot_frame}) to the laser, and poses in the frame "
            f"{mapping.map_frame} on {', '.join(sorted(asked))}."
        )
    elif found := _pose_topics(path):
        yield f"It has poses, perhaps on the map: try --pose-topic {found[0]}."
    else:
        yield "Or name a topic with the robot's pose on the map, as --pose-topic /amcl_pose."
    for top in sorted({top for top in lasers.tops.values() if "odom" not in top}):
        yield (
            f"If {top} is the log's map, say so in a mapping file: well_known: true, "
            f"frames: {{map: {top}}}."
        )


def _is_alone(topic: str, top: str, lasers: Lasers) -> bool:
    """Tell whether a laser's frame is in no transform: then no pose of the robot helps."""
    return lasers.why_not.get(topic) == f"{top} is in no transform"


def _pose_topics(path: Path) -> list[str]:
    with open_bag(path) as bag:
        channels = list(bag.channels)
    possible = ONLY_TYPES[ReadPose]
    return sorted({each.topic for each in channels if each.message_type.name in possible})
