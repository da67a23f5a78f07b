"""Reads the scans that were kept next to a log, however the recorder ended."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from typing import Any, BinaryIO

from semmap_log.analysis.scans.visit import (
    FORGET_NS,
    LASER_KEY,
    METADATA,
    ROBOT_KEY,
    VISITS_TOPIC,
    KeptVisit,
    PlacedScan,
    Visit,
    scans_folder,
    visit_key,
)
from semmap_log.core.model.doors import DoorId
from semmap_log.interop.formats.bags.bag_protocol import MAGIC
from semmap_log.interop.formats.bags.unpacking import (
    MESSAGE,
    OpenChunk,
    Record,
    Tally,
    parsed,
    records,
)
from semmap_log.interop.formats.kept_scans import scan_messages
from semmap_log.interop.formats.parsing.foreign_file import open_regular
from semmap_log.interop.formats.ros.ros_types import POSE_WITH_COVARIANCE, decoded

Tell = Callable[[str], None]


def has_kept_scans(log: PurePath) -> bool:
    """Return whether scans are kept next to a log; never for one in a store."""
    folder = scans_folder(log)
    return folder.is_dir() and any(folder.glob("*.mcap"))


def kept_visits(
    log: PurePath,
    log_id: str,
    *,
    since_ns: int | None = None,
    until_ns: int | None = None,
    doors: Collection[DoorId] | None = None,
    with_scans: Callable[[Visit], bool] | None = None,
    tell: Tell | None = None,
) -> Iterator[KeptVisit]:
    """Yield the visits that are kept next to a log, file by file, as they ended.

    A visit that is kept twice, as by an import that was restarted, is yielded once.

    Args:
        log: The log's folder.
        log_id: Its identity: scans of another log that had its name are passed over.
        since_ns: Visits that ended from then on.
        until_ns: Before then.
        doors: Of these alone.
        with_scans: Whose scans are read, too; None: those of all.
        tell: Called with files that are cut off, or belong to another log.
    """
    wanted = _Wanted(since_ns, until_ns, doors, with_scans)
    known: set[tuple[object, ...]] = set()
    for path in sorted(scans_folder(log).glob("*.mcap")):
        for kept in _visits_in(path, log_id, wanted, tell):
            key = visit_key(kept.visit)
            if key not in known:
                known.add(key)
                yield kept


def kept_already(log: PurePath, log_id: str) -> frozenset[tuple[object, ...]]:
    """Return the keys of all visits that are kept next to a log."""
    found = kept_visits(log, log_id, with_scans=lambda _: False)
    return frozenset(visit_key(kept.visit) for kept in found)


def scans_of_event(
    log: PurePath, log_id: str, *, door_id: DoorId, happened_ns: int
) -> KeptVisit | None:
    """Return the visit that became the event about a door at that time; None: it is not kept."""
    found = kept_visits(
        log, log_id, since_ns=happened_ns, doors=[door_id],
        with_scans=lambda visit: visit.first_ns <= happened_ns <= visit.last_ns,
    )  # fmt: skip
    return next((kept for kept in found if kept.scans), None)


@dataclass(frozen=True, slots=True)
class _Wanted:
    since_ns: int | None
    until_ns: int | None
    doors: Collection[DoorId] | None
    with_scans: Callable[[Visit], bool] | None

    def __contains__(self, visit: object) -> bool:
        assert isinstance(visit, Visit)
        return (
            (self.since_ns is None or visit.last_ns >= self.since_ns)
            and (self.until_ns is None or visit.last_ns < self.until_ns)
            and (self.doors is None or visit.door_id in self.doors)
        )

    def scans_of(self, visit: Visit) -> bool:
        """Return whether its scans are wanted, too."""
        return self.with_scans is None or self.with_scans(visit)


def _visits_in(path: Path, log_id: str, wanted: _Wanted, tell: Tell | None) -> Iterator[KeptVisit]:
    """Yield the visits of a file up to where it ends."""
    with open_regular(path) as file:
        reader = FileReader(file)
        said = ""
        try:
            for told in reader.visits(log_id):
                if told.visit in wanted:
                    scans = reader.scans_of(told) if wanted.scans_of(told.visit) else ()
                    yield KeptVisit(told.visit, told.level, told.line, scans, told.event)
        except AnotherLogError as error:
            said = str(error)
        except ValueError as error:
            said = f"read up to where it is damaged: {error}"
        if not said and not reader.is_whole:
            said = (
                "its end was never written (the recorder was killed?); all that is there was read"
            )
        if said and tell is not None:
            tell(f"{path}: {said}")


class AnotherLogError(Exception):
    """The file is of another log."""


@dataclass(slots=True)
class ScanChannel:
    """A topic of a file."""

    topic: str
    of: tuple[str, str]
    """Robot and laser."""
    ros_type: str


@dataclass(slots=True)
class FileReader:
    """Reads a file of kept scans once, from its start."""

    file: BinaryIO
    is_whole: bool = False
    """Whether its end was reached."""
    is_ours: bool = False
    """Whether it says that it is of the log that was meant."""
    _types: dict[int, str] = field(default_factory=dict)
    _channels: dict[int, ScanChannel] = field(default_factory=dict)
    _waiting: defaultdict[tuple[str, str], dict[int, scan_messages.ScanBytes]] = field(
        default_factory=lambda: defaultdict(dict)
    )
    """Robot and laser -> stamp -> the messages of a scan that a visit may be of."""

    def visits(self, log_id: str) -> Iterator[scan_messages.VisitRecord]:
        """Yield the visits, as they were written.

        Raises:
            ValueError: The file is damaged from there on.
            AnotherLogError: It is not of that log.
        """
        for channel, at_ns, data in self.messages(log_id):
            if channel.topic == VISITS_TOPIC:
                told = visit_in(data)
                yield told
                self._forget(told.visit)
            else:
                self._take(channel, at_ns, data)

    def messages(self, log_id: str) -> Iterator[tuple[ScanChannel, int, bytes]]:
        """Yield channel, time and data of each message, as they were written.

        Raises:
            ValueError: The file is damaged from there on.
            AnotherLogError: It is not of that log.
        """
        from mcap import records as kinds
        from mcap.opcode import Opcode

        if self.file.read(len(MAGIC)) != MAGIC:
            raise ValueError("expected an MCAP file, got something else")
        size = self.file.seek(0, 2)
        tally = Tally(size)
        wanted = {Opcode.METADATA, Opcode.CHUNK, Opcode.DATA_END}
        for record in up_to_the_tear(self.file, len(MAGIC), size, wanted):
            if record.opcode == Opcode.METADATA:
                self.is_ours = self.is_ours or _is_of(parsed(kinds.Metadata, record), log_id)
            elif record.opcode == Opcode.DATA_END:
                self.is_whole = True
                return
            elif record.opcode == Opcode.CHUNK:
                if not self.is_ours:
                    raise ValueError("it does not say which log it is of")
                yield from self._chunk(OpenChunk(record, tally))

    def scans_of(self, told: scan_messages.VisitRecord) -> tuple[PlacedScan, ...]:
        """Return the scans of the visit that was yielded last.

        Raises:
            ValueError: They are damaged.
        """
        visit = told.visit
        here = self._waiting[visit.robot, visit.laser]
        return tuple(
            scan_messages.scan_from_messages(
                here[stamp_ns], level=told.level, laser=visit.laser, robot=visit.robot
            )
            for stamp_ns in told.stamps_ns
            if stamp_ns in here
        )

    def _chunk(self, chunk: OpenChunk) -> Iterator[tuple[ScanChannel, int, bytes]]:
        from mcap import records as kinds
        from mcap.opcode import Opcode

        for record in chunk.records({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE}):
            if record.opcode == Opcode.SCHEMA:
                schema = parsed(kinds.Schema, record)
                self._types[schema.id] = schema.name
            elif record.opcode == Opcode.CHANNEL:
                self._know(parsed(kinds.Channel, record))
            else:
                yield self._message(record)

    def _know(self, channel: Any) -> None:
        of = channel.metadata.get(ROBOT_KEY, ""), channel.metadata.get(LASER_KEY, "")
        ros_type = self._types.get(channel.schema_id, "")
        self._channels[channel.id] = ScanChannel(channel.topic, of, ros_type)

    def _message(self, record: Record) -> tuple[ScanChannel, int, bytes]:
        if len(record.body) < MESSAGE.size:
            raise ValueError(f"the message at byte {record.at:,} of a chunk is cut")
        number, _, at_ns, _ = MESSAGE.unpack_from(record.body)
        channel = self._channels.get(number)
        if channel is None:
            raise ValueError(f"the message at byte {record.at:,} of a chunk is of no channel")
        return channel, at_ns, record.body[MESSAGE.size :]

    def _take(self, channel: ScanChannel, at_ns: int, data: bytes) -> None:
        name = {
            POSE_WITH_COVARIANCE: "pose",
            scan_messages.SCAN: "scan",
            scan_messages.CLOUD: "beams",
        }.get(channel.ros_type)
        if name is not None:
            here = self._waiting[channel.of]
            here[at_ns] = replace(here.get(at_ns, _NOTHING), **{name: data})

    def _forget(self, visit: Visit) -> None:
        here = self._waiting[visit.robot, visit.laser]
        for stamp_ns in [each for each in here if each < visit.last_ns - FORGET_NS]:
            del here[stamp_ns]


def visit_in(data: bytes) -> scan_messages.VisitRecord:
    """Return the contents of a message on the topic of visits.

    Raises:
        ValueError: It is not the text of a visit.
    """
    return scan_messages.read_text(decoded(2, data, scan_messages.TEXT).data)


_NOTHING = scan_messages.ScanBytes(b"", b"", b"", None)


def _is_of(metadata: Any, log_id: str) -> bool:
    """Return whether a record names that log as the file's.

    Raises:
        AnotherLogError: It says that it is of another.
    """
    if metadata.name != METADATA:
        return False
    if metadata.metadata.get("log_id") != log_id:
        raise AnotherLogError("these are scans of another log, which had this one's name; "
                               "passed over")  # fmt: skip
    return True


def up_to_the_tear(
    file: BinaryIO, start: int, end: int, wanted: Collection[int]
) -> Iterator[Record]:
    """Yield the records of a file; one that the end of the file cuts, and no more."""
    found = records(file, start, end, wanted)
    while True:
        try:
            record = next(found)
        except (StopIteration, ValueError):
            return
        yield record
