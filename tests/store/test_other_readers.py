"""Closed segments, and the folder, read the same in every tool of the field."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import SeekingReader
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2.metadata import dump_qos_v9

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    FloorMap,
    HistoryTrimmed,
    LevelAdded,
    LogExported,
    MomentPinned,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    SightingsThinned,
)
from semmap_log.store.compaction import compact
from semmap_log.store.writing import segment_chain

DOOR = DoorId(1)

ONE_OF_EACH: list[Event] = [
    LevelAdded(level=1, name="ground floor", elevation=0.5),
    FloorMap(
        level=0, resolution=0.5, origin_x=-1.0, origin_y=2.0, cells=np.eye(4, 3, dtype=np.int8)
    ),
    FloorMap(
        level=1, resolution=0.5, origin_x=0.0, origin_y=0.0, cells=np.ones((300, 400), np.int8)
    ),
    DoorAdded(door_id=DOOR, level=1, x=1.5, y=2.5, theta=0.25, width=0.9, state=DoorState.CLOSED),
    DoorAdded(door_id=DoorId(2), level=0),
    DoorAnnotated(door_id=DOOR, key="name", value="Tür 1 / вход"),
    DoorUpdated(door_id=DOOR, changed=Changed.PROB_OPEN, prob_open=0.125),
    DoorObserved(door_id=DOOR, state=DoorState.OPEN, accuracy_open=0.9, accuracy_closed=0.8),
    DoorRequested(door_id=DOOR, state=DoorState.OPEN),
    DoorPassed(door_id=DOOR, passed=True, waited_s=1.5),
    PatrolStarted(patrol=1),
    PatrolFinished(patrol=1),
    RobotPose(level=1, x=1.0, y=2.0, theta=3.0),
    DoorRemoved(door_id=DoorId(2)),
    LogExported(format="yaml", file_name="doors.yaml", at_ns=5),
    HistoryTrimmed(
        next_event=1, events_gone=0, notes_gone=0, horizon=0, reasons="", rule="", tombstones=""
    ),
    MomentPinned(at_ns=5, name="audit"),
    SightingsThinned(door_id=DOOR, state=DoorState.OPEN, count=3, first_ns=1, last_ns=2),
    ClassDefined(class_name="dock", geometry="point", states="free,taken", blocks=""),
    Retracted(first_event=7, last_event=7),
]


@pytest.fixture(params=["as written", "compacted", "merged"])
def log(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log of three segments with every kind of event, levels, notes and a long commit."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 20)
    path = tmp_path / "building one"
    with sl.create(path, tz="Europe/Vienna", robot="r2", compact=False) as made:
        made.append(ONE_OF_EACH, note=sl.Note(actor="survey", reason="first visit"))
        for i in range(50):
            made.observe(DOOR, "open" if i % 2 else "closed", accuracy=0.9, at=1000 + i)
        made.append(
            [
                FloorMap(
                    level=1,
                    resolution=0.5,
                    origin_x=0.0,
                    origin_y=0.0,
                    cells=np.zeros((2, 2), np.int8),
                )
            ]
        )
        made.append(DoorObserved(door_id=DOOR, state=DoorState.OPEN) for _ in range(20_000))
    if request.param != "as written":
        compact(path, merge=request.param == "merged", keep_s=0)
    return path


def ours(path: Path) -> list[tuple[str, int, int]]:
    """Return (topic, recorded, happened) of every message of our own reading, in order."""
    from semmap_log.store.byte_layout import FLOOR_MAP_CHANNEL, floor_map_topic, topics

    names = {topic.channel_id: topic.topic for topic in topics()}
    found = []
    for _, page in sl.read(path)._reader.pages():
        heads = page.heads
        for channel, recorded, happened in zip(
            heads["channel_id"].tolist(),
            heads["log_time"].tolist(),
            heads["publish_time"].tolist(),
            strict=True,
        ):
            topic = names.get(channel) or floor_map_topic(channel - FLOOR_MAP_CHANNEL).topic
            found.append((topic, recorded, happened))
    return found


@pytest.mark.slow
def test_mcap_seeking_reader(log: Path) -> None:
    """By the index, CRCs checked: the same messages in the same order, and true statistics."""
    theirs = []
    for path in sorted(log.glob("*.mcap")):
        with path.open("rb") as file:
            reader = SeekingReader(file, validate_crcs=True)
            summary = reader.get_summary()
            messages = list(reader.iter_messages())
            assert summary is not None
            assert summary.statistics is not None
            assert summary.statistics.message_count == len(messages)
            assert summary.statistics.attachment_count == len(list(reader.iter_attachments())) == 1
            theirs += [(c.topic, m.log_time, m.publish_time) for _, c, m in messages]

    assert ours(log) == theirs


def test_mcap_stream_reader_checks_the_data_crc(log: Path) -> None:
    """Record by record to the footer, with the CRC of the whole data section."""
    for path in sorted(log.glob("*.mcap")):
        with path.open("rb") as file:
            kinds = [type(r).__name__ for r in StreamReader(file, validate_crcs=True).records]

        assert kinds[-1] == "Footer"
        assert (2, 1) == (kinds.count("Metadata"), kinds.count("Attachment"))


@pytest.mark.slow
@pytest.mark.parametrize("whole", [True, False], ids=["folder", "files"])
def test_rosbags(log: Path, whole: bool) -> None:
    """The folder by its metadata.yaml, and the loose files; payloads by the embedded schemas."""
    paths = [log] if whole else sorted(log.glob("*.mcap"))
    with AnyReader(paths) as reader:
        theirs = [(c.topic, t) for c, t, _ in reader.messages()]
        values = [
            reader.deserialize(raw, c.msgtype)
            for c, _, raw in reader.messages()
            if c.topic == "/semmap/door_observed"
        ]
        count = reader.message_count

    assert [(topic, recorded) for topic, recorded, _ in ours(log)] == theirs
    assert count == len(theirs)
    assert observed(log) == [
        (v.door_id, v.state, v.accuracy_open, v.accuracy_closed) for v in values
    ]


def observed(log: Path) -> list[tuple[int, int, float, float]]:
    """Return the fields of all sightings, by our own reading."""
    return [
        (row["door_id"], row["state"], row["accuracy_open"], row["accuracy_closed"])
        for batch in sl.read(log).batches(kinds=[DoorObserved], retracted=True)
        for row in batch[DoorObserved]
    ]


@pytest.mark.slow
def test_mcap_ros2_support_decodes_every_type(log: Path) -> None:
    """The usual Python decoder reads each message by the schema in the file."""
    from mcap_ros2.decoder import DecoderFactory

    theirs: list[Any] = []
    for path in sorted(log.glob("*.mcap")):
        with path.open("rb") as file:
            reader = SeekingReader(file, decoder_factories=[DecoderFactory()])
            theirs += [(m.channel.topic, m.decoded_message) for m in reader.iter_decoded_messages()]

    assert len(ours(log)) == len(theirs)
    notes = [message for topic, message in theirs if topic == "/semmap/commit_note"]
    assert [("survey", "first visit")] == [(note.actor, note.reason) for note in notes]
    annotations = [m for topic, m in theirs if topic == "/semmap/door_annotated"]
    assert ["Tür 1 / вход"] == [m.value for m in annotations]


@pytest.mark.viewer
def test_rerun_finds_nothing_wrong(log: Path) -> None:
    """`rerun mcap check` of each segment exits with 0."""
    rerun_cli = pytest.importorskip("rerun_cli")
    binary = Path(rerun_cli.__path__[0]) / "rerun"
    for path in sorted(log.glob("*.mcap")):
        done = subprocess.run(
            [binary, "mcap", "check", path], capture_output=True, text=True, check=False
        )

        assert (0, True) == (done.returncode, "/semmap/commit" in done.stdout), done.stderr


@pytest.mark.node
def test_node_reads_the_same(log: Path, node_packages: Path) -> None:
    """@mcap/core by its index, @foxglove/rosmsg2-serialization by the embedded schemas."""
    script = Path(__file__).with_name("read_mcap.mjs")
    done = subprocess.run(
        ["node", script, *sorted(log.glob("*.mcap"))],
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": str(Path(which("node") or "").parent), "NODE_PACKAGES": str(node_packages)},
    )
    assert 0 == done.returncode, done.stderr

    theirs = [json.loads(line) for line in done.stdout.splitlines()]

    assert [[t, str(r), str(h)] for t, r, h in ours(log)] == [row[:3] for row in theirs]
    assert observed(log) == [tuple(row[3]) for row in theirs if row[0] == "/semmap/door_observed"]


def test_the_folder_is_a_rosbag2_without_its_live_segment(tmp_path: Path) -> None:
    """While the first segment is live there is no metadata.yaml."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door()
        assert not (path / "metadata.yaml").exists()

    assert (path / "metadata.yaml").exists()
    code = (
        "import sys; from rosbags.rosbag2 import Reader\n"
        "with Reader(sys.argv[1]) as reader: print(reader.message_count)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, path], capture_output=True, text=True, check=True
    )
    assert "3" == done.stdout.strip()


def test_qos_is_in_the_words_of_rosbag2(log: Path) -> None:
    """Its version 9 takes a number for an unknown policy, and plays nothing."""
    said = yaml.safe_load((log / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    with AnyReader([log]) as reader:
        read = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}

    for topic in said["topics_with_message_count"]:
        name = topic["topic_metadata"]["name"]
        profiles = topic["topic_metadata"]["offered_qos_profiles"]
        assert dump_qos_v9(read[name]) == profiles
        stays = name.startswith("/map") or name == "/semmap/keyframe"
        assert ["transient_local" if stays else "volatile"] == [p["durability"] for p in profiles]
