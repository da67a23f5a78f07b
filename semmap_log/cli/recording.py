"""`record --ros1`, `record --ros2`: the topics of a robot, or what would be made of them."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from semmap_log.cli.common import on_stop, print_json, say, stopped_for_good
from semmap_log.cli.failures import tell
from semmap_log.cli.plain_streams import json_text
from semmap_log.cli.ros import open_node

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semmap_log.core.model.commits import Note
    from semmap_log.core.model.events import Event
    from semmap_log.interop.formats.ros.ros_types import RosVersion
    from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper
    from semmap_log.interop.topics.topic_rules import RosMapping
    from semmap_log.live.ros.ros_recorder import EventSink
    from semmap_log.log.door_log.door_log import DoorLog
    from semmap_log.log.door_log.door_log_writer import DoorLogWriter
    from semmap_log.log.signing.sign_beside import SignBeside

NODE = "semmap_log_recorder"


class Promised(NamedTuple):
    """What is promised of events: see `semmap_log.append`."""

    durability: str
    batch_events: int
    batch_s: float


class Read(NamedTuple):
    """What is read."""

    mapping: Path | None
    """Which topics are read, and how; None: the well-known ones."""
    scan: list[str] | None
    """The topics of lasers; an empty name: those called `scan`; None: those of the mapping."""
    pose_topic: str | None
    heights: tuple[float, float] | None = None
    level: str | None = None
    """Where the robot drives; None: as the mapping says, or the log's only one."""
    keep_scans: bool = False
    """Keep the scans of visits beside the log."""
    clicks: bool = False
    """Points that are clicked in RViz are doors."""


def record_topics(
    context: typer.Context,
    log: Path,
    version: RosVersion,
    read: Read,
    promised: Promised | None,
    *,
    signer: SignBeside | None = None,
    as_json: bool = False,
) -> None:
    """Record until Ctrl-C, or SIGTERM, or until ROS ends.

    Args:
        context: Of the verb: it has ROS's own arguments.
        log: Where to.
        version: Of ROS.
        read: Which topics, and how.
        promised: How durable the events are; None: they are shown, and nothing is written.
        signer: Signs what is written.
        as_json: Of what was written, at the end one document.

    Raises:
        typer.Exit: Messages were dropped.
    """
    import semmap_log as sl
    from semmap_log.interop.topics.mapping_file import read_mapping
    from semmap_log.interop.topics.topic_rules import WELL_KNOWN
    from semmap_log.live.ros.ros_recorder import LogSink, PrintedSink

    with stopped_for_good():
        mapping = WELL_KNOWN if read.mapping is None else read_mapping(read.mapping)
        if read.scan is not None:
            mapping = mapping.asked_for(read.scan, read.pose_topic or "", read.heights)
        if read.level is not None:
            mapping = replace(mapping, level=read.level)
        if read.clicks:
            mapping = mapping.with_clicks()
        if read.keep_scans and not mapping.reads_scans:
            raise typer.BadParameter(
                "no laser is read: name it with --scan, or in the mapping",
                param_hint="--keep-scans",
            )
    if promised is None:
        known = sl.read(log) if log.exists() else None
        _check_level(known, read.level)
        _record(context, version, mapping, PrintedSink(_show, known), "nothing was written")
        return
    with stopped_for_good():
        opened = sl.append(log, signer=signer, **promised._asdict())
    with opened:
        _check_level(opened, read.level)
        with _keeping(opened, wanted=read.keep_scans) as keeper:
            _record(
                context, version, mapping, LogSink(opened), str(log), keeper=keeper,
                as_json=as_json,
            )  # fmt: skip


def _check_level(log: DoorLog | None, level: str | None) -> None:
    """Refuse a level that is not there, before ROS is asked."""
    from semmap_log.core.folds.levels import resolve_level
    from semmap_log.core.model.doors import DoorMap

    if level is not None:
        with stopped_for_good():
            resolve_level(level, DoorMap({}, {}) if log is None else log.replay())


@contextmanager
def _keeping(log: DoorLogWriter, *, wanted: bool) -> Iterator[ScanKeeper | None]:
    """Hand out what keeps scans, if they are wanted; if they cannot be kept, recording goes on."""
    from semmap_log.interop.formats.kept_scans.writing import keeping_scans
    from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper

    if not wanted:
        yield None
        return
    with keeping_scans(log.path, log.info.log_id) as writer:
        yield ScanKeeper(writer, tell=tell)
        if writer.path is not None:
            say(f"{writer.path}: the scans of visits.")


def _record(
    context: typer.Context, version: RosVersion, mapping: RosMapping, sink: EventSink, where: str,
    *, keeper: ScanKeeper | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    from semmap_log.live.ros.ros_recorder import RosRecorder

    recorder = RosRecorder(open_node(context, version, NODE), mapping, sink, tell, keeper)

    def stop() -> None:
        recorder.stopping = True

    on_stop(stop)
    recorder.run()
    for text in recorder.summary():
        say(f"  {text}")
    if as_json:
        print_json({"log": where, **asdict(recorder.counts)})
    else:
        say(f"{where}: {recorder.counts}.")
    if recorder.counts.dropped:
        raise typer.Exit(1)


def _show(event: Event, note: Note) -> None:
    from semmap_log.interop.formats.json.event_json import event_to_json

    said = {"actor": note.actor, "source": note.source, "reason": note.reason}
    typer.echo(json_text(event_to_json(event, note=said)))
