"""Keeps the scans of visits next to a log, in a new file for each run, and removes them again.

What is removed are visits and their scans, since those show where the robot was.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, BinaryIO

from semmap_log.analysis.scans.visit import (
    FORGET_NS,
    FORM,
    LASER_KEY,
    METADATA,
    ROBOT_KEY,
    TF_TOPIC,
    VISITS_TOPIC,
    DoorLine,
    PlacedScan,
    Visit,
    file_name,
    scans_folder,
    topic_part,
)
from semmap_log.core.io.disk import atomic_file, output_errors, sync_folder
from semmap_log.core.messages import LIBRARY, PROFILE
from semmap_log.interop.formats.bags.bag_protocol import BagTopic, qos_of
from semmap_log.interop.formats.kept_scans import reading, scan_messages
from semmap_log.interop.formats.parsing.foreign_file import open_regular
from semmap_log.interop.formats.ros.ros_types import (
    POSE_WITH_COVARIANCE,
    TRANSFORMS,
    Messages,
    encoded,
    ros_types,
)

Goes = Callable[[Visit], bool]
Laser = tuple[str, str]
"""Robot and laser; empty: what is of no laser."""


@dataclass(frozen=True, slots=True)
class VisitsInFile:
    """Which visits of a file of kept scans go."""

    path: Path
    going: int
    """How many."""
    staying: Mapping[Laser, _Spans]
    """When the others were."""
    robots: frozenset[str]
    """The robots of those that go."""
    problem: str = ""
    """Why it could not be read to its end."""


def visits_in_file(path: Path, log_id: str, goes: Goes) -> VisitsInFile | None:
    """Return which visits of a file go; None: it is not known to be of that log.

    Args:
        path: The file.
        log_id: The log's identity.
        goes: Returns whether a visit is removed.

    Raises:
        FormatError: It cannot be opened.
    """
    going, robots, problem = 0, set[str](), ""
    staying: defaultdict[Laser, list[tuple[int, int]]] = defaultdict(list)
    with open_regular(path) as file:
        reader = reading.FileReader(file)
        try:
            for told in reader.visits(log_id):
                visit = told.visit
                if goes(visit):
                    going += 1
                    robots.add(visit.robot)
                else:
                    for of in ((visit.robot, visit.laser), ("", "")):
                        staying[of].append((visit.first_ns, visit.last_ns))
        except reading.AnotherLogError:
            return None
        except ValueError as error:
            problem = str(error)
    if not reader.is_ours:
        return None
    spans = {of: _Spans(some) for of, some in staying.items()}
    return VisitsInFile(path, going, spans, frozenset(robots), problem)


def take_out_visits(found: VisitsInFile, log_id: str, goes: Goes) -> None:
    """Take visits out of a file, with the scans that are theirs alone; without others, remove it.

    Args:
        found: What `visits_in_file` returned.
        log_id: The log's identity.
        goes: Returns whether a visit is removed.

    Raises:
        OutputError: It cannot be written, or removed; it is as it was.
        ValueError: It is damaged; it is as it was.
    """
    path = found.path
    with output_errors(path):
        if found.staying:
            _write_staying(found, log_id, goes)
            return
        path.unlink()
        sync_folder(path.parent)
        with suppress(OSError):  # something else is in it
            path.parent.rmdir()


def _write_staying(found: VisitsInFile, log_id: str, goes: Goes) -> None:
    """Rewrite the file; each message that stays keeps its bytes."""
    with open_regular(found.path) as file, atomic_file(found.path) as temporary:
        made = VisitFile(temporary, temporary.open("wb"), log_id)
        for channel, at_ns, data in reading.FileReader(file).messages(log_id):
            if not _stays(found, goes, channel, at_ns, data):
                continue
            made.write(channel.topic, channel.ros_type, channel.of, at_ns, data)
            if channel.topic == VISITS_TOPIC:
                made.flush()  # a visit is a chunk
        made.close()


def _stays(
    found: VisitsInFile, goes: Goes, channel: reading.ScanChannel, at_ns: int, data: bytes
) -> bool:
    if channel.topic == VISITS_TOPIC:
        return not goes(reading.visit_in(data).visit)
    return channel.of in found.staying and at_ns in found.staying[channel.of]


class _Spans:
    """Stretches of time, both ends included."""

    def __init__(self, spans: Iterable[tuple[int, int]]) -> None:
        self._firsts, self._lasts = list[int](), list[int]()
        for first, last in sorted(spans):
            if self._lasts and first <= self._lasts[-1]:
                self._lasts[-1] = max(self._lasts[-1], last)
            else:
                self._firsts.append(first)
                self._lasts.append(last)

    def __contains__(self, at_ns: int) -> bool:
        place = bisect_right(self._firsts, at_ns) - 1
        return place >= 0 and at_ns <= self._lasts[place]


CHUNK_BYTES = 2**20
"""A visit of more is in several chunks."""


@contextmanager
def keeping_scans(log: PurePath, log_id: str) -> Iterator[KeptScansWriter]:
    """Keep scans next to a log; the file is closed when the block ends, however it ends.

    Args:
        log: The log's folder.
        log_id: Its identity, so that nobody takes them for those of another log of that name.

    Raises:
        OutputError: The file cannot be finished.
    """
    writer = KeptScansWriter(log, log_id)
    try:
        yield writer
    finally:
        writer.close()


class KeptScansWriter:
    """Takes visits that ended; the first one makes the file."""

    def __init__(self, log: PurePath, log_id: str) -> None:
        self._log, self._log_id = log, log_id
        self._file: VisitFile | None = None

    @property
    def path(self) -> Path | None:
        """The file; None: there was no visit yet."""
        return None if self._file is None else self._file.path

    def keep(
        self,
        visit: Visit,
        *,
        line: DoorLine,
        level: int,
        scans: Sequence[PlacedScan],
        event: int | None = None,
    ) -> None:
        """Write a visit, so that a process that is killed now loses nothing of it.

        Args:
            visit: It has ended.
            line: Of the door, at that moment.
            level: On which it is.
            scans: All that it was made from, of its laser and robot; also those that another visit
                was made from, which are written once.
            event: Number of the event that it became.

        Raises:
            OutputError: It cannot be written.
        """
        if self._file is None:
            self._file = VisitFile.new(scans_folder(self._log), visit.first_ns, self._log_id)
        self._file.add(visit, line, level, scans, event)

    def abandon(self) -> None:
        """Let go of the file as it is: it cannot be written to any more."""
        if self._file is not None:
            self._file.let_go()
            self._file = None

    def discard(self) -> None:
        """Take away what was written: nothing came of it."""
        if self._file is not None:
            self._file.remove()
            self._file = None

    def close(self) -> None:
        """Finish the file, if there is one.

        Raises:
            OutputError: It cannot be written.
        """
        if self._file is not None:
            self._file.close()


class VisitFile:
    """One MCAP."""

    @classmethod
    def new(cls, folder: Path, first_ns: int, log_id: str) -> VisitFile:
        """Make a file that was not there.

        Raises:
            OutputError: It cannot be made.
        """
        number = 0
        with output_errors(folder):
            folder.mkdir(exist_ok=True)
            while True:
                path = folder / file_name(first_ns, number)
                try:
                    return cls(path, path.open("xb"), log_id)
                except FileExistsError:
                    number += 1

    def __init__(self, path: Path, file: BinaryIO, log_id: str) -> None:
        from mcap.writer import Writer

        self.path, self._file = path, file
        self._writer = Writer(file, chunk_size=CHUNK_BYTES, enable_data_crcs=True)
        self._writer.start(profile=PROFILE, library=LIBRARY)
        self._writer.add_metadata(METADATA, {"form": FORM, "log_id": log_id})
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str, str], int] = {}
        self._topics: set[str] = set()
        self._written: defaultdict[tuple[str, str], dict[int, None]] = defaultdict(dict)
        """Robot and laser -> stamps of the scans that are in the file, and not forgotten yet."""

    def add(
        self,
        visit: Visit,
        line: DoorLine,
        level: int,
        scans: Sequence[PlacedScan],
        event: int | None,
    ) -> None:
        """Write a visit, as `KeptScansWriter.keep`."""
        ordered = sorted(scans, key=lambda scan: scan.stamp_ns)
        with output_errors(self.path):
            for scan in ordered:
                self._add_scan(scan)
            stamps_ns = tuple(scan.stamp_ns for scan in ordered)
            text = scan_messages.text_of(
                scan_messages.VisitRecord(visit, level, line, stamps_ns, event)
            )
            message = encoded(2, Messages(2).new(scan_messages.TEXT, data=text), scan_messages.TEXT)
            self.write(VISITS_TOPIC, scan_messages.TEXT, ("", ""), visit.last_ns, message)
            self.flush()
        self._forget(visit)

    def let_go(self) -> None:
        """Close the file without an end."""
        with suppress(OSError):
            self._file.close()

    def remove(self) -> None:
        """Take the file away, and the folder, if nothing else is in it."""
        self.let_go()
        with output_errors(self.path):
            self.path.unlink(missing_ok=True)
        with suppress(OSError):
            self.path.parent.rmdir()

    def close(self) -> None:
        """Write the file's end."""
        with output_errors(self.path):
            if not self._file.closed:
                with self._file:
                    self._writer.finish()

    def flush(self) -> None:
        """Hand all to the system; libraries that cannot end a chunk keep up to `CHUNK_BYTES`."""
        if hasattr(self._writer, "flush"):
            self._writer.flush()
        else:
            self._file.flush()

    def _add_scan(self, scan: PlacedScan) -> None:
        of = scan.robot, scan.laser
        if scan.stamp_ns in self._written[of] or not len(scan.bearings):
            return
        self._written[of][scan.stamp_ns] = None
        parts = [part for part in map(topic_part, of) if part]
        told = scan_messages.scan_to_messages(scan, "/".join(parts) or "laser")
        root = "".join(f"/{part}" for part in parts)
        self.write(TF_TOPIC, TRANSFORMS, ("", ""), scan.stamp_ns, told.transform)
        self.write(f"{root}/pose", POSE_WITH_COVARIANCE, of, scan.stamp_ns, told.pose)
        if told.beams is not None:
            self.write(f"{root}/beams", scan_messages.CLOUD, of, scan.stamp_ns, told.beams)
        self.write(f"{root}/scan", scan_messages.SCAN, of, scan.stamp_ns, told.scan)

    def _forget(self, visit: Visit) -> None:
        stamps = self._written[visit.robot, visit.laser]
        for stamp_ns in list(stamps):
            if stamp_ns < visit.last_ns - FORGET_NS // 2:
                del stamps[stamp_ns]

    def write(
        self, topic: str, ros_type: str, of: tuple[str, str], at_ns: int, data: bytes
    ) -> None:
        """Write a message.

        Args:
            topic: Its topic.
            ros_type: Its type.
            of: Robot and laser; empty: of none.
            at_ns: Its time.
            data: Its CDR.
        """
        key = (topic, *of)
        if key not in self._channels:
            self._channels[key] = self._channel(topic, ros_type, of)
        self._writer.add_message(self._channels[key], log_time=at_ns, data=data, publish_time=at_ns)

    def _channel(self, topic: str, ros_type: str, of: tuple[str, str]) -> int:
        """Return a new channel; lasers whose topics are spelt alike get different names."""
        types: Any = ros_types(2)
        if ros_type not in self._schemas:
            text, _ = types.generate_msgdef(ros_type, ros_version=2)
            self._schemas[ros_type] = self._writer.register_schema(
                ros_type, "ros2msg", text.encode()
            )
        name, number = topic, 1
        while name in self._topics:
            number += 1
            name = f"{topic}_{number}"
        self._topics.add(name)
        channel: int = self._writer.register_channel(
            name,
            "cdr",
            self._schemas[ros_type],
            {
                "offered_qos_profiles": qos_of(BagTopic(name, ros_type, is_latched=False)),
                "topic_type_hash": types.hash_rihs01(ros_type),
                **dict(zip((ROBOT_KEY, LASER_KEY), of, strict=True)),
            },
        )
        return channel
