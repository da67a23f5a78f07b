"""The page of the log format is enough to read a log: the reader that it ends with does.

The reader is cut out of the page and runs in a Python of its own that cannot import semmap_log.
What it says must be what the product says.
"""

from __future__ import annotations

import json
import math
import random
import re
import shutil
import struct
import subprocess
import sys
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from doc_pages import ROOT, blocks_of
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.core.messages import layout
from semmap_log.core.model.events import DoorAdded, FloorMap, LevelAdded
from semmap_log.errors import EarlyEventsWarning, HorizonError
from semmap_log.log.trimming.redaction import Annotation, Notes, Redaction, Tracks
from semmap_log.log.trimming.trim_log import Retention, TrimRule, trim_log
from semmap_log.store.byte_layout import trimmed_topics
from semmap_log.store.header import LogInfo, SegmentHeader, Trimmed, TrimReason
from semmap_log.store.reading.reader import LogReader

PAGE = (ROOT / "docs" / "log_format.md").read_text(encoding="utf-8")
(READER,) = [block.text for block in blocks_of(PAGE) if block.language == "python"]
GUARD = "import sys; sys.modules['semmap_log'] = None\n"
"""Makes each import of the product an error."""


def run_reader(log: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Return what the page's program does with a log."""
    line = [sys.executable, "-I", "-c", GUARD + READER, str(log), *options]
    return subprocess.run(line, capture_output=True, text=True, check=False)


def read_by_page(log: Path, *options: str) -> dict[str, Any]:
    """Return what the page's program says of a log."""
    done = run_reader(log, *options)
    assert 0 == done.returncode, done.stderr
    said: dict[str, Any] = json.loads(done.stdout)
    return said


def number(value: float) -> float | None:
    return None if math.isnan(value) else value


def without_nan(said: dict[str, Any]) -> dict[str, Any]:
    doors = [
        {key: number(value) if isinstance(value, float) else value for key, value in door.items()}
        for door in said["doors"]
    ]
    return {**said, "doors": doors}


def read_by_product(path: Path, **moment: int | None) -> dict[str, Any]:
    """Return the same of semmap-log."""
    log = sl.read(path)
    commits = list(log.commits())
    doors = [
        {
            "door_id": door.door_id,
            "name": door.name,
            "level": door.level,
            "x": number(door.x),
            "y": number(door.y),
            "theta": number(door.theta),
            "width": number(door.width),
            "state": door.state.name,
            "prob_open": number(door.prob_open),
            "prob_closed": number(door.prob_closed),
            "last_seen_ns": door.last_seen_ns,
        }
        for door in log.replay(**moment).doors.values()
    ]
    return {
        "events": commits[-1].last_event + 1,
        "commits": len(commits),
        "head": commits[-1].hash.hex(),
        "doors": doors,
    }


def write_eventful(log: sl.DoorLogWriter, rng: random.Random) -> None:
    """Let everything happen that the page tells of: late, taken back, removed, on two levels."""
    cells = np.zeros((40, 50), np.int8)
    log.append([LevelAdded(level=0, name="ground"), LevelAdded(level=1, name="first")])
    log.append([FloorMap(level=1, resolution=0.05, origin_x=0, origin_y=0, cells=cells)])
    doors = [
        log.add_door(x=i, y=1, theta=0.5, width=0.9, level=i % 2, name=f"door {i}")
        for i in range(6)
    ]
    doors.append(log.add_door(name="no place", level=0))
    for _ in range(60):
        door = rng.choice(doors)
        at = log.now_ns() - rng.choice([0, 10**6, 5 * 10**6])
        match rng.randrange(6):
            case 0:
                log.update_door(door, state=rng.choice(["open", "closed"]), prob_open=0.25, at=at)
            case 1:
                log.passed(door, passed=rng.random() < 0.5, at=at)
            case 2:
                log.annotate(door, "name", f"door {rng.randrange(100, 10**6)}", at=at)
            case 3:
                log.update_door(door, x=2.5, y=rng.random(), theta=1, width=1.5, level=1, at=at)
            case _:
                log.observe(door, rng.choice(["open", "closed", "moving"]), accuracy=0.9, at=at)
    last = log.observe(doors[0], "offline", reason="a wrong one")
    log.retract(last.first_event, actor="tester")
    log.remove_door(doors[3])


@pytest.fixture
def live(tmp_path: Path) -> Path:
    """A log whose writer has not closed it: a copy, as a power cut leaves it."""
    clock, rng = SteadyClock(), random.Random(7)
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", clock=clock, entropy=rng.randbytes) as log:
        write_eventful(log, rng)
        shutil.copytree(path, tmp_path / "live")
    return tmp_path / "live"


def segment_of(log: Path) -> Path:
    (path,) = log.glob("*.mcap")
    return path


@pytest.mark.parametrize("name", ["office", "clinic_week"])
def test_a_shipped_recording(name: str) -> None:
    """
    Doors, names, states, counts and the head of the hash chain, over one segment and over seven.
    """
    log = ROOT / "recordings" / name

    assert read_by_product(log) == without_nan(read_by_page(log))


HOURS = ("07:35", "08:30", "10:30", "11:00", "13:30", "14:30", "15:30", "19:30", "20:30")
"""Between a wrong sighting and its retraction, between what happened and its late report …"""


@pytest.mark.parametrize("names", ["at", "known_at", "at known_at"])
def test_moments_of_a_shipped_recording(names: str) -> None:
    """What was true, what was known, and both: known at each moment is what was true at 10:30."""
    log = ROOT / "recordings" / "office"
    said = set()

    for hour in HOURS:
        moment = dict.fromkeys(names.split(), sl.read(log).instant(f"2026-03-02T{hour}"))
        if len(moment) == 2:
            moment["at"] = sl.read(log).instant("2026-03-02T10:30")
        options = [f"--{name.replace('_', '-')}={ns}" for name, ns in moment.items()]
        by_page = without_nan(read_by_page(log, *options))
        assert read_by_product(log, **moment) == by_page
        said.add(json.dumps(by_page))

    assert len(said) == {"at": 7, "known_at": 9, "at known_at": 4}[names]


@pytest.mark.parametrize("which", ["log", "live"])
def test_a_log_with_everything_in_it(which: str, live: Path) -> None:
    log = live.parent / which

    said = read_by_page(log)

    assert read_by_product(log) == without_nan(said)
    assert 6 == len(said["doors"])


INDEX_BYTES = 62
"""Of what ends the file: the MessageIndexes of two messages, which nobody needs."""


@pytest.mark.parametrize("cut", [1, 62, 63, 200, 500, 1500, 4000])
def test_a_torn_tail(cut: int, live: Path) -> None:
    """Wherever the file ends: the last whole commit is the last one that counts."""
    whole = read_by_page(live)["commits"]
    segment = segment_of(live)
    with segment.open("r+b") as file:
        file.truncate(segment.stat().st_size - cut)

    said = read_by_page(live)

    assert read_by_product(live) == without_nan(said)
    assert (said["commits"] < whole) == (cut > INDEX_BYTES)


def test_a_changed_event_does_not_fit_its_hash(live: Path) -> None:
    """Also where whoever changed it made the chunk's checksum anew."""
    segment = segment_of(live)
    data = bytearray(segment.read_bytes())
    at = data.rindex(struct.pack("<d", 0.9))
    start = data.rindex(b"\x06", 0, at)
    while not _is_chunk(data, start, at):
        start = data.rindex(b"\x06", 0, start)
    data[at : at + 8] = struct.pack("<d", 0.8)
    body = start + 9 + 28 + 4 + 8  # no compression
    (size,) = struct.unpack_from("<Q", data, start + 9 + 16)
    struct.pack_into("<I", data, start + 9 + 24, zlib.crc32(data[body : body + size]))
    segment.write_bytes(data)

    done = run_reader(live)

    assert done.stderr.strip().endswith("a Commit that does not fit its hash")
    assert 1 == done.returncode


def _is_chunk(data: bytearray, start: int, inside: int) -> bool:
    """Tell whether an uncompressed Chunk that begins there holds a byte."""
    length, _, _, size, crc, name = struct.unpack_from("<QQQQII", data, start + 1)
    body = start + 9 + 28 + 4 + 8
    holds = name == 0 and length == 40 + size and body <= inside < body + size
    return holds and zlib.crc32(data[body : body + size]) == crc


def test_a_log_without_its_first_segment_is_refused(tmp_path: Path) -> None:
    """The reader follows the page's rules for the order of segments."""
    log = tmp_path / "clinic"
    shutil.copytree(ROOT / "recordings" / "clinic_week", log)
    min(log.glob("*.mcap")).unlink()

    assert "a segment is missing" in run_reader(log).stderr


OF_ALL = 10**9
HOURS_OF_SUNDAY = ("00:30", "09:00", "10:17", "15:00", "20:30")


@pytest.mark.parametrize(
    "parts",
    [[Tracks()], [Notes()], [Notes("tinyRobot1"), Annotation(1, "name")]],
    ids=["tracks", "notes", "notes of one actor, and a name"],
)
def test_a_redacted_log(parts: list[Any], tmp_path: Path) -> None:
    """All of its moments can be asked about, and the head of the hash chain is the product's."""
    log = tmp_path / "office"
    shutil.copytree(ROOT / "recordings" / "office", log)

    done = trim_log(log, Redaction(parts, OF_ALL)).done

    assert done.events + done.notes
    assert read_by_product(log) == without_nan(read_by_page(log))
    for hour in HOURS:
        moment = sl.read(log).instant(f"2026-03-02T{hour}")
        for name in ("at", "known_at"):
            by_page = read_by_page(log, f"--{name.replace('_', '-')}={moment}")
            assert read_by_product(log, **{name: moment}) == without_nan(by_page)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A week of which the last day is kept; and its last names were redacted before."""
    log = tmp_path_factory.mktemp("kept") / "clinic"
    shutil.copytree(ROOT / "recordings" / "clinic_week", log)
    until = sl.read(log).instant("2026-03-08T10:00")
    assert until is not None
    rules: list[TrimRule] = [Redaction([Annotation(3, "name"), Notes()], OF_ALL)]
    rules.append(Retention(LogReader(log), until))
    assert all(trim_log(log, rule).done.segments for rule in rules)
    return log


@pytest.mark.parametrize("names", ["at", "known_at"])
def test_a_log_with_a_horizon(names: str, kept: Path) -> None:
    """The doors at each moment behind it, from the keyframe that stands there."""
    assert read_by_product(kept) == without_nan(read_by_page(kept))
    for hour in HOURS_OF_SUNDAY:
        moment = sl.read(kept).instant(f"2026-03-08T{hour}")
        by_page = read_by_page(kept, f"--{names.replace('_', '-')}={moment}")
        assert read_by_product(kept, **{names: moment}) == without_nan(by_page)


@pytest.mark.parametrize("option", ["--at", "--known-at"])
def test_a_moment_before_the_horizon_is_refused(option: str, kept: Path) -> None:
    moment = LogReader(kept).horizon_ns - 1

    assert "is no longer kept" in run_reader(kept, f"{option}={moment}").stderr
    with pytest.raises(HorizonError, match="no longer kept"):
        sl.read(kept).replay(**{option[2:].replace("-", "_"): moment})


@pytest.mark.parametrize("at", [-1, 0, 1])
def test_an_annotation_counts_since_its_door_was_added(at: int, tmp_path: Path) -> None:
    """One that says it was before, or at that very moment and with a lesser number, is none."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock()) as log:
        added_ns = log.now_ns() - 10**9
        log.append([DoorAdded(door_id=7, x=1, y=2, theta=0, width=1, happened_ns=added_ns)])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", EarlyEventsWarning)
            log.annotate(7, "name", "early", at=f"@{added_ns + at}")

    assert read_by_product(tmp_path / "log") == without_nan(read_by_page(tmp_path / "log"))
    (door,) = sl.read(tmp_path / "log").replay().doors.values()
    assert door.name == (None if at < 0 else "early")


def test_what_is_left_of_a_commit_is_held_to_its_tombstone(tmp_path: Path) -> None:
    """A segment that claims that something else was left."""
    log = tmp_path / "office"
    shutil.copytree(ROOT / "recordings" / "office", log)
    trim_log(log, Redaction([Tracks()], OF_ALL))
    reader = READER.replace('lacks["kept_digest"][32', 'lacks["digest"][32')

    line = [sys.executable, "-I", "-c", GUARD + reader, str(log)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)

    assert "what is left is not what was kept" in done.stderr


def _table(heading: str) -> list[list[str]]:
    """Return the cells of the first table below a heading, without its head; backticks off."""
    below = PAGE[PAGE.index(f"# {heading}\n") :]
    lines = re.findall(
        r"^\| (.*) \|$", below[: below.index("\n\n", below.index("\n| "))], re.MULTILINE
    )
    return [[cell.strip(" `") for cell in line.split("|")] for line in lines[2:]]


def test_the_table_of_channels_is_the_products() -> None:
    """Ids, topics and types."""
    told = {row[0]: (row[1], row[2]) for row in _table("Channels and messages")}

    floor = told.pop("100 + level, schema 13")
    assert {
        str(topic.channel_id): (topic.topic, topic.ros_type)
        for topic in trimmed_topics()
        if topic.channel_id != 100
    } == told
    assert floor[1] == next(t.ros_type for t in trimmed_topics() if t.channel_id == 100)


def test_the_table_of_a_commits_bytes_is_the_products() -> None:
    """Offsets, sizes and order."""
    commit = layout("Commit").dtype
    assert commit.fields is not None
    below = PAGE[PAGE.index("That of a Commit is") :]
    told = re.findall(r"^\| (\d+) \| (\d+) \| (\w+) \|$", below, flags=re.MULTILINE)

    assert {
        (str(field[1]), str(field[0].itemsize), name) for name, field in commit.fields.items()
    } == {row for row in told if row[2] != "padding"}
    assert f"a Commit is {commit.itemsize} bytes" in PAGE
    assert commit.itemsize == 4 + sum(int(size) for _, size, _ in told)


def test_the_table_of_the_heads_entries_is_the_products() -> None:
    """Each key that a writer writes, and those that it leaves out when they say nothing."""
    info, trimmed = LogInfo("0" * 32, "UTC", holds=5), Trimmed(TrimReason.EXPIRED, 9, 7)
    header = SegmentHeader(info, 0, 0, bytes(32), minor=1, trimmed=trimmed)
    told = {
        key for row in _table("The head: Metadata `semmap_log`") for key in row[0].split("`, `")
    }

    assert set(header.to_metadata().metadata) == told
