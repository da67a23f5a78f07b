"""The log's form on disk: names, numbers and channels that never change.

    <log>/
      <log>_000000.mcap   a segment: closed (whole, indexed, never modified) or, the last, live
      <log>_000001.mcap
      closed-1-2000.json  how far they reached when one was closed: a cut log is no short one
      metadata.yaml       for rosbag2's tools; a cache, absent while no segment is closed
      .lock               held by the one writer

A segment: Header (profile `ros2`), Metadata `semmap_log`, every Schema and Channel, a chunk with a
Keyframe, then commits. A commit is a chunk, or several of about a MiB: its events, its CommitNote
if there is something to say, and last its Commit, which alone makes the events visible. Between
chunks, about two a MiB, stand further Keyframes: chunks of their own, outside of all commits, with
the log time of the record before. Closing adds

- Metadata `semmap_index`: how many events each chunk has and when they happened (`header`), and
  under `head` the hash of the segment's last commit (that of the head's Metadata, if it has none);
- the Attachment `semmap_commands`, if there is a commit: by it a command that is sent again is
  found (`command_index`);
- DataEnd with the data's CRC, the summary and the Footer.

Logs that were closed before there were `head` and `semmap_commands` have neither, and are read
from their commits.

Versions. `format_version` in `semmap_log` is the major one: a program reads its own and no other.
`format_minor` (0 where it is missing) counts what was added since. What a later minor version may
add, and what a program that does not know it does with that:

- Kinds of events, on channels up to 89, with a Schema and a Channel of their own at the head of
  each segment. They take event numbers, and belong to commits and to the hash chain as all others
  do. A kind that changes no answer about others says so in its Channel's metadata,
  `semmap_changes: nothing`: it hides no event, and leaves doors, beliefs, levels, floor plans,
  poses and rounds as they are, and of a keyframe all but its event number and latest time. Such
  events are left out, with a warning. An event of any other unknown kind may have changed
  everything: a question that counts only events before it (`--event`, `--known-at`) is answered,
  a list of events shows it by its name, and all else is refused. A changed type is a kind of its
  own, under a new name.
- Entries in `semmap_log`. They hold for the whole log.
- Entries in `semmap_index`, which are a cache; a state version of keyframes, which are one, too.

Whoever rewrites segments (compaction, recovery, the next segment of a log) keeps all of it byte for
byte, except caches. Everything else needs a new major version: other records in a segment, other
channels of the log's own (90 to 99), and other values of existing fields.

Version 4 is that of *trimmed* segments: closed ones from which records were taken out on purpose,
by retention, thinning or redaction (`store/trimming`). All others stay at version 3. A trimmed
segment has gaps in its event numbers, and a Tombstone where something is gone.

The fixed fields of the events among message records, as columns: by numpy.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.disk import TEMPORARY_SUFFIX
from semmap_log.core.lazily import late_pattern
from semmap_log.core.messages import (
    BAG_METADATA_NAME,
    OBJECT_KINDS,
    TRANSIENT_LOCAL,
    VOLATILE,
    fixed_layout,
    ros_type,
    type_name,
)
from semmap_log.core.model.events import DOOR_KINDS, KINDS, FloorMap
from semmap_log.store import records as mcap

NAMES_OF_FILES = (".mcap", ".zip")
"""How the name of a segment ends, and of a log that was packed; no folder of a log is called so."""

FORMAT_VERSION = "3"
"""The major one."""
TRIMMED_VERSION = "4"
"""That of a segment from which records were taken out."""
KINDS_OF_MINOR = (14, 18)
"""How many of `KINDS` each minor version has: who adds a kind adds a version."""
FORMAT_MINOR = len(KINDS_OF_MINOR) - 1

LOG_METADATA = "semmap_log"
INDEX_METADATA = "semmap_index"
COMMAND_ATTACHMENT = "semmap_commands"
CHANGES_KEY, NOTHING = "semmap_changes", "nothing"
"""In the metadata of a later kind's Channel: what its events change of the answers about others."""
DIGEST_KEY = "sha256"
"""Each of our Metadata records carries the sha256 of its other entries under this key."""

HASH_BYTES = 32
NO_HASH = bytes(HASH_BYTES)
"""What the first commit of a log has as its predecessor's hash."""

LOCK_NAME = ".lock"
NEW_LOCK_NAME = ".lock.tmp"
"""A lock file that only writers can read, before it takes the place of one that all can."""
OLD_MARK_NAME = "closed.json"
"""How far the log reached when its last segment was closed, as versions before `closed_mark` named
it: one file, which each closing replaced."""
MANIFEST_NAME = "manifest.json"
"""Which segments lie in a store: `manifest`."""
REMOVED_NAME = "shipped.json"
"""Which segments were removed from the disk once they were shipped: `removed_part`."""
MOST_LIST_BYTES = 2**24
"""Of a file that lists segments: these three. A manifest of 28,000 segments has as many."""
KEPT_SUFFIX = ".kept"
"""Of the file that keeps what questions about all of a log need of a removed segment."""
TORN_SUFFIX = ".torn"
RECOVERING_NAME = ".recovering"
"""In a log that `recover` has rebuilt, until the damaged one is put away."""

CHUNK_BYTES = 2**20
"""A longer commit is split into chunks of about this size (uncompressed)."""
KEYFRAME_EVERY_BYTES = 2**19
"""A keyframe follows so many bytes of records, so that a moment reads about as many …"""
KEYFRAME_RARITY = 16
"""… but at least so many times its own size: a map of many doors must not fill the log."""
COMPRESS_FROM_BYTES = 2**16
"""Chunks from this size on (imports, floor maps) are written with zstd; small ones as they are."""

ZSTD_LEVEL = 3

MOST_NAME_BYTES = 200

ROLL_BYTES = 64 * 2**20
ROLL_COMMITS = 10_000
ROLL_AGE_NS = 24 * 3600 * 10**9
CONTINUE_BELOW_BYTES = 2**20
"""A smaller last segment is continued (in a copy), so that a thousand commands make one file."""

LAST_EVENT_CHANNEL = 89
"""A kind's number is its channel, that of a later version's kind, too; only floor maps have theirs
further up."""
COMMIT_CHANNEL = 90
NOTE_CHANNEL = 91
KEYFRAME_CHANNEL = 92
SEQUENCE_RANGE = 2**32
"""A message's sequence is the number of its event, or of the last before it, modulo this."""
TOMBSTONE_CHANNEL = 93
"""In trimmed segments only."""
FLOOR_MAP_CHANNEL = 100
"""Level 0; level n is on channel 100 + n, written before first use in each segment."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A channel of every segment."""

    channel_id: int
    schema_id: int
    topic: str
    ros_type: str
    durability: str = VOLATILE
    """As rosbag2 has it; `transient_local`: who subscribes late gets the latest."""
    since_minor: int = 0
    """The first minor version that has it."""
    changes_nothing: bool = False
    """As its kind says: `Event.changes_nothing`."""


def has_name_of_file(path: Path) -> bool:
    """Return whether a path has the name of a segment, or of a zip of a log."""
    return path.suffix.lower() in NAMES_OF_FILES


def snake_case(name: str) -> str:
    """Return `DoorAdded` as `door_added`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def floor_map_topic(level: int) -> Topic:
    """Return the channel of a level's floor map."""
    topic = "/map" if level == 0 else f"/map/{level}"
    return Topic(
        FLOOR_MAP_CHANNEL + level, FloorMap.kind, topic, ros_type(FloorMap.kind), TRANSIENT_LOCAL
    )


@cache
def topics() -> tuple[Topic, ...]:
    """Return the channels that stand at the head of every segment, ids ascending."""
    events = [
        Topic(
            cls.kind,
            cls.kind,
            f"/semmap/{snake_case(cls.__name__)}",
            ros_type(cls.kind),
            since_minor=bisect_left(KINDS_OF_MINOR, cls.kind),
            changes_nothing=cls.changes_nothing,
        )
        for cls in KINDS
        if cls is not FloorMap
    ]
    care = [
        _own_topic(COMMIT_CHANNEL, "Commit"),
        _own_topic(NOTE_CHANNEL, "CommitNote"),
        _own_topic(KEYFRAME_CHANNEL, "Keyframe", TRANSIENT_LOCAL),
    ]
    return (*events, *care, floor_map_topic(0))


@cache
def trimmed_topics() -> tuple[Topic, ...]:
    """Return the channels that stand at the head of a trimmed segment, ids ascending."""
    *others, floor_map = topics()
    return (*others, _own_topic(TOMBSTONE_CHANNEL, "Tombstone"), floor_map)


def _own_topic(channel: int, name: str, durability: str = VOLATILE) -> Topic:
    """Return the channel of what is no event."""
    return Topic(channel, channel, f"/semmap/{snake_case(name)}", type_name(name), durability)


def kind_of_channel(channel_id: int) -> int | None:
    """Return the kind of event on that channel; None: Commit, CommitNote, Keyframe or foreign.

    A number beyond those of `KINDS` is that of a later version's kind.
    """
    if channel_id >= FLOOR_MAP_CHANNEL:
        return FloorMap.kind
    return channel_id if 1 <= channel_id <= LAST_EVENT_CHANNEL else None


def count_events(counts: Mapping[int, int]) -> int:
    """Return how many events there are among so many messages on each channel."""
    return sum(count for channel, count in counts.items() if kind_of_channel(channel))


def is_temporary(name: str) -> bool:
    """Return whether that is the temporary name of a file that a writer makes."""
    others = (BAG_METADATA_NAME, OLD_MARK_NAME, ".closed-", REMOVED_NAME, KEPT_SUFFIX)
    ours = name == NEW_LOCK_NAME or ".mcap" in name or any(one in name for one in others)
    return name.startswith(".") and name.endswith(TEMPORARY_SUFFIX) and ours


def mark_name(segment: int, next_event: int) -> str:
    """Return the name of the file that states how far a log reached: `closed_mark`."""
    return f"closed-{segment}-{next_event}.json"


def is_name_of_part(name: str) -> bool:
    """Return whether a file in a log's folder is part of the log, once it is whole."""
    return (
        (name.endswith((".mcap", KEPT_SUFFIX)) and not name.startswith("."))
        or name in (BAG_METADATA_NAME, REMOVED_NAME, LOCK_NAME)
        or is_mark_name(name)
    )


def is_mark_name(name: str) -> bool:
    """Return whether a file states how far a log reached."""
    return name[:6] == "closed" and (name == OLD_MARK_NAME or bool(_MARK.fullmatch(name)))


def mark_names(names: Iterable[str]) -> list[str]:
    """Return those names that state how far a log reached, the farthest last.

    The mark of older versions does not show it in its name: it comes first.
    """
    marks = [name for name in names if name[:6] == "closed" and is_mark_name(name)]
    return sorted(marks, key=_place_in) if len(marks) > 1 else marks


def _place_in(mark: str) -> tuple[int, ...]:
    found = _MARK.fullmatch(mark)
    return tuple(map(int, found.groups())) if found else ()


_MARK = late_pattern(r"closed-(\d{1,19})-(\d{1,19})\.json", re.ASCII)


def segment_name(log: str, number: int) -> str:
    """Return the file name of a segment: the log's name, made plain, and a number.

    Names go into metadata.yaml, and temporary names are longer: so no characters that cannot be
    printed, and at most `MOST_NAME_BYTES`.
    """
    name = log.encode("utf-8", "replace").decode()
    plain = "".join(c if c.isprintable() and c not in "/\\\"'" else "_" for c in name)
    while len(plain.encode()) > MOST_NAME_BYTES:
        plain = plain[:-1]
    return f"{plain or 'log'}_{number:06d}.mcap"


def number_in(name: str) -> int | None:
    """Return the number in a segment's file name; None: it has none."""
    found = _NUMBER.search(name)
    return int(found[1]) if found else None


def stem_of(name: str) -> str:
    """Return a segment's file name without its number."""
    return _NUMBER.sub("", name).removesuffix(".mcap")


def is_named_as_part(name: str, merged: str, first: int, last: int) -> bool:
    """Return whether a file has the name of a segment that was merged into another.

    Args:
        name: The file's.
        merged: That of the merged segment's file.
        first: Number of the first of the segments that are in it.
        last: Number of the last.
    """
    number = number_in(name)
    return number is not None and first < number <= last and stem_of(name) == stem_of(merged)


_NUMBER = late_pattern(r"_(\d{6,})\.mcap$")


KIND_OF_CHANNEL = np.full(2**16, FloorMap.kind, np.uint8)
"""The kind of each possible channel; those after the first floor map's carry floor maps, too."""
KIND_OF_CHANNEL[:FLOOR_MAP_CHANNEL] = [
    kind_of_channel(channel) or 0 for channel in range(FLOOR_MAP_CHANNEL)
]

ABOUT_A_DOOR = np.zeros(2**8, np.bool_)
"""Of each kind: whether its events begin with the door that they are about."""
ABOUT_A_DOOR[list(DOOR_KINDS - OBJECT_KINDS)] = True

FIXED_KINDS = frozenset(kind.kind for kind in KINDS) - OBJECT_KINDS
"""Kinds whose events are read in place, as columns."""


def kinds_of(channels: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return the kind of event on each channel; 0: Commit, CommitNote, Keyframe or foreign."""
    kinds: NDArray[np.uint8] = KIND_OF_CHANNEL.take(channels)
    return kinds


@cache
def message_lengths() -> NDArray[np.int64]:
    """Return the length of a message record of each kind, frame left out; -1: any."""
    lengths = np.full(2**8, -1, np.int64)
    for kind in FIXED_KINDS:
        lengths[kind] = mcap.MESSAGE_BODY_HEAD + fixed_layout(kind).dtype.itemsize
    return lengths


class HeadColumns(Protocol):
    """Columns by their names."""

    def __getitem__(self, name: str, /) -> NDArray[Any]:
        """Return a column."""
        ...


class EventFields(NamedTuple):
    """A row for each event."""

    place: NDArray[np.int64]
    """Which of the message records it is."""
    number: NDArray[np.int64]
    """Event number."""
    kind: NDArray[np.uint8]
    happened_ns: NDArray[np.int64]
    """As given."""
    recorded_ns: NDArray[np.int64]
    door_id: NDArray[np.uint32]
    """The door that it is about; 0 if it is about none, or if its payload must be decoded first."""

    @classmethod
    def room_for(cls, count: int) -> EventFields:
        """Return rows for the caller to fill."""
        return cls(
            place=np.empty(count, np.int64),
            number=np.empty(count, np.int64),
            kind=np.empty(count, np.uint8),
            happened_ns=np.empty(count, np.int64),
            recorded_ns=np.empty(count, np.int64),
            door_id=np.empty(count, np.uint32),
        )

    def chosen(self, rows: NDArray[np.bool_] | slice) -> EventFields:
        """Return some rows: for each whether it is wanted, or a slice of them."""
        return EventFields(
            self.place[rows],
            self.number[rows],
            self.kind[rows],
            self.happened_ns[rows],
            self.recorded_ns[rows],
            self.door_id[rows],
        )


def fields_of(heads: HeadColumns, first_event: int) -> EventFields:
    """Return the fields of the events among message records.

    Args:
        heads: The fixed fields of all of them: `HEAD_DTYPE`.
        first_event: Event number at which their segment begins.
    """
    kinds = kinds_of(heads["channel_id"])
    place = np.flatnonzero(kinds)
    kind = kinds.take(place)
    door_id = heads["door_id"].take(place)
    door_id[~ABOUT_A_DOOR.take(kind)] = 0
    return EventFields(
        place=place,
        number=numbers_of_sequence(heads["sequence"].take(place), first_event),
        kind=kind,
        happened_ns=heads["publish_time"].take(place),
        recorded_ns=heads["log_time"].take(place),
        door_id=door_id,
    )


def numbers_of_sequence(sequence: NDArray[np.uint32], first_event: int) -> NDArray[np.int64]:
    """Return event numbers from records that contain only their low 32 bits.

    Args:
        sequence: What the records say.
        first_event: Event number at which their segment begins.
    """
    first = np.uint32(first_event & 0xFFFF_FFFF)
    numbers: NDArray[np.int64] = (sequence - first).astype(np.int64)
    numbers += first_event
    return numbers
