"""A bag's laser scans into a log: what they saw of the doors, a commit for each visit.

The command line, or the mapping, names the lasers. The bag is read once before anything is written:
it is read whole, or nothing is imported. Each visit has an id of its own, made of the bag's bytes
and of what was seen when: an import that was interrupted resumes where it stopped, and the same bag
again changes nothing. If no scan has a place on the map, the error says why, and what to do.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from semmap_log.core.batches.event_batch import one_by_one
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import command_line
from semmap_log.errors import CommandError, FormatError
from semmap_log.interop.formats.bags.bag_protocol import BagChannel, BagReader
from semmap_log.interop.formats.bags.bag_reading import open_bag
from semmap_log.interop.formats.ros import ros_types
from semmap_log.interop.importing import bag_importing
from semmap_log.interop.importing.import_plan import ImportPlan
from semmap_log.interop.topics import topic_rules
from semmap_log.interop.topics.lasers.lasers import Lasers, RobotScan
from semmap_log.interop.topics.lasers.scan_keeper import (
    LaserSightings,
    ScanKeeper,
    VisitCommit,
    counts_of,
    door_oddities_of,
    named,
    oddities_of,
)
from semmap_log.interop.topics.topic_reader import Known, TopicProblems
from semmap_log.interop.topics.translator import Translator
from semmap_log.log import DoorLog, DoorLogWriter

MOST_TOPICS = 20


@dataclass(frozen=True, slots=True)
class ScanOptions:
    """Which lasers of a bag are read, besides those of a mapping."""

    topics: tuple[str, ...] = ()
    """Empty: the bag's only one; of several, those called `scan`."""
    pose_topic: str = ""
    """Poses of the robot on the map; empty: TF leads from the map to it."""
    heights: tuple[float, float] | None = None
    """Of the points of clouds that count, over the robot's frame, m; None: as usual."""

    def words(self) -> list[str]:
        """Return the options of a command line that ask for the same."""
        words = [word for topic in self.topics or ("",) for word in ("--scan", topic) if word]
        if self.pose_topic:
            words += ["--pose-topic", self.pose_topic]
        if self.heights is not None:
            words += ["--heights", ",".join(f"{each:g}" for each in self.heights)]
        return words


def with_scans(
    path: Path, mapping: topic_rules.RosMapping, options: ScanOptions | None
) -> topic_rules.RosMapping:
    """Return a mapping that reads the requested lasers, as far as the bag has them.

    Raises:
        FormatError: It has no such topic, or several could be meant.
    """
    if options is None:
        return mapping
    topics = _topics(path, mapping, options)
    return mapping.with_scans(topics, options.pose_topic, options.heights)


def _topics(path: Path, mapping: topic_rules.RosMapping, options: ScanOptions) -> Collection[str]:
    with open_bag(path) as bag:
        there = {channel.topic: channel.message_type.name for channel in bag.channels}
    lasers = sorted(topic for topic, name in there.items() if name == ros_types.LASER_SCAN)
    named = [
        (ros_types.whole_topic(topic), topic_rules.ONLY_TYPES[topic_rules.ReadScan])
        for topic in options.topics
    ]
    if options.pose_topic:
        named.append(
            (
                ros_types.whole_topic(options.pose_topic),
                topic_rules.ONLY_TYPES[topic_rules.ReadPlace],
            )
        )
    for topic, possible in named:
        if there.get(topic) not in possible:
            kinds = " or ".join(map(ros_types.short_name, possible))
            raise FormatError(
                path, f"expected a topic {topic} of {kinds}; there is: {_listed(there)}"
            )
    if options.topics:
        return options.topics
    if any(isinstance(rule.reading, topic_rules.ReadScan) for rule in mapping.topics.values()):
        return ()
    called_so = [topic for topic in lasers if topic.endswith("/scan")]
    chosen = lasers if len(lasers) == 1 else called_so
    if not chosen:
        clouds = sorted(topic for topic, name in there.items() if name == ros_types.POINT_CLOUD)
        which = (*lasers, *clouds)
        what = (
            f"it has several: {', '.join(which)}; name those of different lasers: --scan {which[0]}"
            if which
            else f"it has none; there is: {_listed(there)}"
        )
        raise FormatError(
            path, f"expected one topic of {ros_types.short_name(ros_types.LASER_SCAN)}; {what}"
        )
    return chosen


def _listed(topics: dict[str, str]) -> str:
    named = [f"{topic} ({ros_types.short_name(name)})" for topic, name in sorted(topics.items())]
    return ", ".join(named[:MOST_TOPICS]) or "nothing"


AT_ONCE = 64
"""Scans that are looked through together: faster than one by one."""
NO_SCANS = "no scans: the topics that are read have no messages"
TOLD_EVERY = 1000
"""Messages between two words of progress."""


@dataclass(frozen=True, slots=True)
class ScanPlan:
    """What a bag's scans bring."""

    visits: Sequence[bag_importing.PlannedVisit]
    summary: tuple[str, ...]
    warnings: tuple[str, ...]
    """What is odd about the bag."""
    door_warnings: tuple[str, ...]
    """What is odd about doors."""
    held: int = 0
    """So many visits the log has already."""


@dataclass(frozen=True, slots=True)
class BagIds:
    """Of what ids of commits are made, 16 bytes each."""

    bag: bytes
    """Its bytes alone: so a visit is the same by whatever options it was found."""
    topics: bytes
    """Of the commit of the other topics: the same as without scans."""
    earlier: bytes
    """Of the commit that says that doors were there earlier."""


@dataclass(frozen=True, slots=True)
class ScanImport:
    """What a bag brings whose scans are looked through, in the order in which it is written."""

    ids: BagIds
    topics: ImportPlan
    earlier: ImportPlan
    """Doors that were there by then."""
    scans: ScanPlan

    @property
    def summary(self) -> tuple[str, ...]:
        """What all of it does, in words."""
        return (*self.topics.summary, *self.earlier.summary, *self.scans.summary)

    left_out: tuple[str, ...]
    """Topics that nothing reads."""
    topics_held: bool = False
    """The log has the other topics' events already."""

    @property
    def nothing(self) -> str:
        """Why nothing of it can be imported; empty: something can, or the log holds it."""
        if self.topics.count or self.topics_held or self.earlier.count or self.scans.held:
            return ""
        if self.scans.visits:
            return ""
        return "no visit to a door decided anything"

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is odd about it."""
        of_scans = (*self.scans.warnings, *self.scans.door_warnings)
        return tuple(dict.fromkeys((*self.topics.warnings, *of_scans)))


def plan_with_scans(
    log: DoorLog, path: Path, mapping: topic_rules.RosMapping, ids: BagIds, earlier: ImportPlan, *,
    keeper: ScanKeeper | None = None, progress: Progress | None = None, actor: str = "",
) -> ScanImport:  # fmt: skip
    """Return what a bag would bring; nothing is written.

    Args:
        log: As it stands.
        path: The bag.
        mapping: How its topics are read, the lasers among them.
        ids: See there.
        earlier: What says that doors were there by then.
        keeper: What keeps the scans of all visits; None: nobody does.
        progress: Called with (messages read, messages in all).
        actor: Who will be named as who saw it; "": the robot.

    Raises:
        FormatError: The bag cannot be read, or no scan of it has a place on the map.
        CommandError: The map forbids it; or no door was there at the time of the scans.
    """
    topics, others = ImportPlan((), 0), mapping.without_lasers()
    left_out = tuple(bag_importing.left_out_of(path, mapping))
    is_held = _is_stored(log, ids.topics)
    if bag_importing.reads_any(path, others) and not is_held:
        topics = bag_importing.plan_bag(path, log, others, progress=progress)
    others_events = [*one_by_one(earlier.events), *one_by_one(topics.events)]
    scans = plan_scans(
        path, log, mapping, others_events, bag_id=ids.bag, keeper=keeper, progress=progress,
        actor=actor,
    )  # fmt: skip
    return ScanImport(ids, topics, earlier, scans, left_out, is_held)


def append_with_scans(log: DoorLogWriter, found: ScanImport, note: Note) -> tuple[int, int | None]:
    """Append what is not stored yet; return how many events that is, and the first one's number."""
    first: int | None = None
    count = 0
    for plan, command_id in (
        (found.topics, found.ids.topics),
        (found.earlier, found.ids.earlier),
    ):
        if plan.count:
            done = log.append(plan.events, note=note, command_id=command_id, content=command_id)
            first = done.first_event if first is None else first
            count += plan.count
    for each in found.scans.visits:
        said = named(each.commit, note)
        done = log.append(
            said.events, note=said.note, command_id=each.command_id, content=each.command_id,
            sync=False,
        )  # fmt: skip
        first = done.first_event if first is None else first
        count += len(said.events)
    log.sync()
    return count, first


def _is_stored(log: DoorLog, command_id: bytes) -> bool:
    return any(commit.command_id == command_id for commit in log.commits())


def plan_scans(
    path: Path, log: DoorLog, mapping: topic_rules.RosMapping, others: Sequence[Event] = (), *,
    bag_id: bytes, keeper: ScanKeeper | None = None, progress: Progress | None = None,
    actor: str = "",
) -> ScanPlan:  # fmt: skip
    """Return what the scans of a bag say of the doors.

    Args:
        path: The bag.
        log: Whose doors are looked at, as they were when the scans were made.
        mapping: Which lasers are read, and how.
        others: What comes into the log before the scans: it may contain doors.
        bag_id: Digest of the bag.
        keeper: What keeps the scans of all visits; None: nobody does.
        progress: Called with (messages read, messages in all).
        actor: Who will be named as who saw it; "": the robot.

    Raises:
        FormatError: The bag cannot be read, or no scan of it has a place on the map.
        CommandError: No door was there at the time of the scans; or no level is given.
    """
    doors = bag_importing.PlacesOverTime(log, others)
    return _Scanning(path, log, mapping.for_lasers_only(), doors, keeper, actor).plan(
        bag_id, progress
    )


@dataclass(slots=True)
class _Scanning:
    """One going through the lasers' topics of a bag."""

    path: Path
    log: DoorLog
    mapping: topic_rules.RosMapping
    doors: bag_importing.PlacesOverTime
    keeper: ScanKeeper | None = None
    actor: str = ""
    complaints: TopicProblems = field(default_factory=TopicProblems)
    sightings: LaserSightings = field(init=False)
    _first: RobotScan | None = None

    def __post_init__(self) -> None:
        self.sightings = LaserSightings(self.doors, robot=self.log.info.robot, keeper=self.keeper)

    def plan(self, bag_id: bytes, progress: Progress | None) -> ScanPlan:
        known = Known.of(self.log)
        translator = Translator(self.mapping, known, self.complaints)
        visits = list(self._visits(translator, progress))
        self._check_any_placed(translator.lasers)
        ids = (_visit_id(bag_id, self.mapping, each) for each in visits)
        planned = [bag_importing.PlannedVisit(*pair) for pair in zip(ids, visits, strict=True)]
        before = bag_importing.SeenBefore.of(self.log, visits)
        unknown = [each for each in planned if not before.holds(each)]
        new = [each for each in unknown if not before.overlaps(each, self.actor)]
        warnings = list(self._warnings(translator.lasers))
        if len(new) < len(unknown):
            told = f"{len(unknown) - len(new):,}"
            warnings.append(f"left out, since the log has visits of that laser then: {told}")
        summary = list(counts_of(translator.lasers, self.sightings))
        if len(unknown) < len(planned):
            summary.append(f"of them in the log already: {len(planned) - len(unknown):,}")
        odd_doors = tuple(door_oddities_of(self.sightings, known))
        held = len(planned) - len(new)
        return ScanPlan(new, tuple(summary), tuple(warnings), odd_doors, held)

    def _visits(self, translator: Translator, progress: Progress | None) -> Iterator[VisitCommit]:
        waiting: list[RobotScan] = []
        for scan in self.scans(translator, progress):
            self._first = self._first or scan
            waiting.append(scan)
            if len(waiting) >= AT_ONCE:
                yield from self.sightings.take(waiting)
                waiting.clear()
        yield from self.sightings.take(waiting)
        yield from self.sightings.close()

    def scans(self, translator: Translator, progress: Progress | None) -> Iterator[RobotScan]:
        with open_bag(self.path) as bag:
            channels = self._channels(bag, translator)
            fixed = [each for each in channels if each.topic.endswith("tf_static")]
            for message in bag.messages(fixed):  # they hold all the time, also before they came
                channel = message.channel
                translator.take(channel.topic, channel.message_type, message.data, message.at_ns)
            in_all = bag.count(channels)
            for count, message in enumerate(bag.messages(channels), start=1):
                if progress is not None and count % TOLD_EVERY == 0:
                    progress(count, max(in_all, count))
                channel = message.channel
                yield from translator.take(
                    channel.topic, channel.message_type, message.data, message.at_ns
                ).scans
        yield from translator.rest()

    def _channels(self, bag: BagReader, translator: Translator) -> list[BagChannel]:
        chosen: list[BagChannel] = []
        for channel in bag.channels:
            rule = self.mapping.rule(channel.topic, channel.message_type.name)
            if rule is not None:
                if not any(each.topic == channel.topic for each in chosen):
                    translator.read_topic(channel.topic, rule)
                chosen.append(channel)
        return chosen

    def _check_any_placed(self, lasers: Lasers) -> None:
        """Return if a scan has a place, and a door was there then.

        Raises:
            FormatError: No scan has a place.
            CommandError: No door was there.
        """
        if not any(each.received for each in lasers.counts.values()):
            raise FormatError(self.path, NO_SCANS)
        if self._first is None:
            raise FormatError(
                self.path, why_no_place(self.path, lasers, self.mapping, self.complaints)
            )
        if self.sightings.tally.levels:
            return
        now = sum(door.is_placed for door in self.log.replay().doors.values())
        if not now:
            raise CommandError(
                f"{self.log.path}: no door of the log has a place; add them first "
                "(`add`, `import`), or list the doors that the scans show: --propose-doors."
            )
        since = format_local(self._first.scan.stamp_ns, self.log.info.timezone)
        line = command_line("import", self.log.path, str(self.path), "--scan", "--since", since)
        raise CommandError(
            f"{self.path}: the log's doors ({now}) were all added later than these scans, of "
            f"{since}. If they were there already, say so: {line}"
        )

    def _warnings(self, lasers: Lasers) -> Iterator[str]:
        yield from self.complaints.lines()
        zone = self.log.info.timezone
        yield from oddities_of(lasers, self.sightings, lambda ns: format_local(ns, zone))


def _visit_id(bag_id: bytes, mapping: topic_rules.RosMapping, commit: VisitCommit) -> bytes:
    """Return the id of a visit's commit: the same for the same visit in the same bag."""
    visit = commit.visit
    key = (
        "visit", mapping.map_frame, visit.robot, visit.laser, visit.door_id, visit.first_ns,
        visit.last_ns, visit.passed,
    )  # fmt: skip
    return hashlib.sha256(bag_id + repr(key).encode()).digest()[:16]


def placed_scans(
    path: Path, log: DoorLog, mapping: topic_rules.RosMapping, *, progress: Progress | None = None
) -> Iterator[RobotScan]:
    """Yield the scans of a bag that have a place on the map, whatever doors there are.

    Raises:
        FormatError: The bag cannot be read, or no scan of it has a place.
    """
    scanning = _Scanning(path, log, mapping.for_lasers_only(), bag_importing.PlacesOverTime(log))
    translator = Translator(scanning.mapping, Known.of(log), scanning.complaints)
    is_any = False
    for scan in scanning.scans(translator, progress):
        is_any = True
        yield scan
    lasers = translator.lasers
    if not any(each.received for each in lasers.counts.values()):
        raise FormatError(path, NO_SCANS)
    if not is_any:
        raise FormatError(path, why_no_place(path, lasers, scanning.mapping, scanning.complaints))


def why_no_place(
    path: Path, lasers: Lasers, mapping: topic_rules.RosMapping, complaints: TopicProblems
) -> str:
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


def _what_to_do(path: Path, lasers: Lasers, mapping: topic_rules.RosMapping) -> Iterator[str]:
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
    """Return whether a laser's frame is in no transform: then no pose of the robot helps."""
    return lasers.why_not.get(topic) == f"{top} is in no transform"


def _pose_topics(path: Path) -> list[str]:
    with open_bag(path) as bag:
        channels = list(bag.channels)
    possible = topic_rules.ONLY_TYPES[topic_rules.ReadPose]
    return sorted({each.topic for each in channels if each.message_type.name in possible})
