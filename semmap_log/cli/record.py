"""`record`: events as they happen, from JSON lines, or with `--ros1` or `--ros2` from topics.

`--ship`, which sends the log to a store meanwhile, is an option of all verbs that write for long.
"""

from __future__ import annotations

import sys
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from semmap_log.cli import bag_options, writing_options
from semmap_log.cli.common import WritableLog, on_stop, print_json, say, stopped_for_good
from semmap_log.cli.ros import Ros1, Ros2, chosen_ros, open_node
from semmap_log.cli.sanitized_streams import json_text
from semmap_log.cli.verb import HELP_MADE_LATE, problems_to_json, tell

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semmap_log.core.model.commits import Note
    from semmap_log.core.model.events import Event
    from semmap_log.interop.formats.ros.ros_types import RosVersion
    from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper
    from semmap_log.interop.topics.topic_rules import RosMapping
    from semmap_log.live.ros.ros_recorder import EventSink
    from semmap_log.log import BackgroundSigner, DoorLog, DoorLogWriter


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
    """Keep the scans of visits next to the log."""
    clicks: bool = False
    """Points that are clicked in RViz are doors."""


def record_topics(
    context: typer.Context,
    log: Path,
    version: RosVersion,
    read: Read,
    promised: Promised | None,
    *,
    signer: BackgroundSigner | None = None,
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
    from semmap_log.interop.topics.mapping_file import read_mapping
    from semmap_log.interop.topics.topic_rules import WELL_KNOWN
    from semmap_log.live.ros.ros_recorder import LogSink, PrintedSink
    from semmap_log.log import append
    from semmap_log.log import read as read_log

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
        known = read_log(log) if log.exists() else None
        _check_level(known, read.level)
        _record(context, version, mapping, PrintedSink(_show, known), "nothing was written")
        return
    with stopped_for_good():
        opened = append(log, signer=signer, **promised._asdict())
    with opened:
        _check_level(opened, read.level)
        with _keeping(opened, wanted=read.keep_scans) as keeper:
            _record(
                context, version, mapping, LogSink(opened), str(log), keeper=keeper,
                as_json=as_json,
            )  # fmt: skip


def _check_level(log: DoorLog | None, level: str | None) -> None:
    """Refuse a level that is not there, before connecting to ROS."""
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
    from semmap_log.interop.formats.json.door_json import event_to_json

    said = {"actor": note.actor, "source": note.source, "reason": note.reason}
    typer.echo(json_text(event_to_json(event, note=said)))


def _kinds_of_lines() -> str:
    from semmap_log.interop.formats.json.trip_json import help_text

    return help_text()


HELP_MADE_LATE["record"] = _kinds_of_lines


def run(
    context: typer.Context,
    log: WritableLog,
    *,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    mapping: bag_options.MappingFile = None,
    scan: bag_options.Scan = None,
    pose_topic: bag_options.PoseTopic = None,
    heights: bag_options.Heights = None,
    level: bag_options.RobotLevel = None,
    keep_scans: bag_options.KeepScans = False,
    clicked_points: bag_options.ClickedPoints = False,
    dry_run: bag_options.DryRun = False,
    ack: Annotated[
        bool,
        typer.Option("--ack", help="Answer each line once it is stored, with its event number."),
    ] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="Stop at the first bad line, instead of skipping it.")
    ] = False,
    durability: Annotated[
        writing_options.SyncChoice,
        typer.Option(help="What is true of a line when it is answered; see above."),
    ] = writing_options.SyncChoice.event,
    batch_events: Annotated[
        int, typer.Option(min=1, help="batch: so many events at most share a sync.")
    ] = 64,
    batch_ms: Annotated[
        float, typer.Option(min=0, help="batch: a line waits so long for others, at most.")
    ] = 50.0,
    ship: writing_options.ShipTo = None,
    sign_key: writing_options.SignKey = None,
    sign_every: writing_options.SignEvery = writing_options.EVERY,
    adopt: writing_options.Adopt = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="At the end one JSON document: what became of all.")
    ] = False,
) -> None:
    """Record events from standard input, one JSON object a line, or the topics of a robot.

    Until the input ends, or Ctrl-C. Each line is one commit; a door is its door_id or its name. A
    bad line is skipped; then the exit code is 1. Of bad lines of one kind the first three are
    reported with their numbers, the others counted at the end. Exit code 0 means that every line is
    stored. A line with a command_id that is stored already, however long ago, is stored once, and
    answered as it was then. Of an exported log each line is a commit of its own here, recorded now,
    and what was taken back is refused; `import` makes the same log of it.

    With --ros1 or --ros2 it records what topics say about doors: the events of each message are one
    commit, messages that wait share a sync, and what was received before a signal to stop is
    written. What cannot be (NaN, another frame, unknown values) is reported once, and counted.
    Times are the messages' own stamps where those lie in the minute before they came, else when
    they came, by ROS's time. Exit code 2: it would never start like this (no log, a wrong option or
    mapping).

    With --scan a laser sees the doors of the log: each visit to a door that decides is a commit,
    once it is over. Without TOPIC: the topics called scan. TF has to lead from map to the laser.
    Of a log with several levels --level says where the robot drives.
    --keep-scans keeps what the laser saw in LOG.scans, so that a person can check it: `view`,
    `scan-report --plot`.

    With --clicked-points doors are added by hand, in RViz: choose Publish Point and click the
    door's hinge (the start of its line), then its other end, within a minute. Each door is a
    commit, and a line reports it. A width below 0.4 or above 6 m, another frame than map, or a
    point more than 1 m below or 3 m above the floor is refused; a door that the log has, too.

    With --ship each segment is sent to a store once it is closed (after a day, 10,000 commits or 64
    MiB, and at the end), by a thread that recording never waits for. A store that cannot be reached
    is reported once and tried again, at most ten minutes apart. The end waits 30 s for what is
    being sent; what is not sent then is sent the next time, or by `ship`.

    With --sign-key the log's end is signed each minute (--sign-every) and when it is closed, by a
    thread that recording never waits for, and only what this recorder wrote. What cannot be signed
    (a full disk) is reported once, and signed later, or by `sign`. Events found unsigned at the
    start, as a power cut leaves them, are signed by `sign` first, or with --adopt.

    \b
    Durability, when a line is answered:
      event  it survives a power cut (lines that wait already share one sync)
      batch  the same; lines wait a moment for others to share their sync
      flush  it survives the end of this program, not a power cut
      none   it may still be in memory; all is on the disk when the program ends

    \b
    A line is a kind with its keys, which stand at the end of this help:
      {"kind": "DoorObserved", "door": "front", "state": "OPEN", "accuracy": 0.9}
      {"kind": "RobotPose", "x": 1.0, "y": 2.0, "theta": 0.0}

    \b
    Examples:
      my_door_detector | semmap-log record office
      semmap-log record office --ack < events.jsonl
      semmap-log record office --ros1
      semmap-log record office --ros2 --mapping robot.yaml --durability batch
      semmap-log record office --ros2 --ship s3://hospital/logs/office
      semmap-log record office --ros2 --sign-key ~/.ssh/office
      semmap-log record office --ros2 --scan
      semmap-log record office --ros2 --scan --keep-scans
      semmap-log record office --ros2 --scan /points --heights 0.3,1.5 --level L2
      semmap-log record office --ros2 --clicked-points
    """
    if ros1 or ros2:
        if ack or strict:
            raise typer.BadParameter(
                "is about lines of standard input", param_hint="--ack, --strict"
            )
        bag_options.check_scan(scan, pose_topic, heights)
        bag_options.check_keep_scans(keep_scans=keep_scans, dry_run=dry_run)
        version = chosen_ros(ros1=ros1, ros2=ros2)
        policy = Promised(durability.value, batch_events, batch_ms / 1000)
        read = Read(
            mapping,
            scan,
            pose_topic,
            bag_options.heights_of(heights),
            level,
            keep_scans=keep_scans,
            clicks=clicked_points,
        )
        if dry_run and ship is not None:
            raise typer.BadParameter("nothing is written with --dry-run", param_hint="--ship")
        if dry_run and sign_key is not None:
            raise typer.BadParameter("nothing is written with --dry-run", param_hint="--sign-key")
        signer = writing_options.signer_of(log, sign_key, sign_every, adopt=adopt)
        with writing_options.with_shipping(log, ship), writing_options.with_signing(log, signer):
            record_topics(
                context, log, version, read, None if dry_run else policy, signer=signer,
                as_json=as_json,
            )  # fmt: skip
        return
    of_lasers = any(each is not None for each in (scan, pose_topic, heights)) or keep_scans
    if mapping or level or dry_run or of_lasers or clicked_points or context.obj:
        raise typer.BadParameter(
            "is for topics: say which ROS, --ros1 or --ros2",
            param_hint="--mapping, --level, --scan, --pose-topic, --heights, --keep-scans, "
            "--clicked-points, --dry-run",
        )
    if ack and as_json:
        raise typer.BadParameter("answers each line as JSON already", param_hint="--ack")
    from semmap_log.core.texts import MOST_LISTED, Repeats, counted
    from semmap_log.live.ros.line_recorder import LineAnswer, LineRecorder
    from semmap_log.log import append

    refused = Repeats()

    def answer(one: LineAnswer) -> None:
        if one.error and refused.add(one.line, one.error).count <= MOST_LISTED:
            tell(f"line {one.line}: {one.error}")
        if ack:
            said = {
                "line": one.line,
                **({"error": one.error} if one.error else {"event": one.event}),
            }
            sys.stdout.write(json_text(said) + "\n")
            sys.stdout.flush()

    signer = writing_options.signer_of(log, sign_key, sign_every, adopt=adopt)
    with (
        writing_options.with_shipping(log, ship),
        writing_options.with_signing(log, signer),
        append(
            log,
            durability=durability.value,
            batch_events=batch_events,
            batch_s=batch_ms / 1000,
            signer=signer,
        ) as opened,
    ):
        recorder = LineRecorder(opened, answer, strict=strict)

        def stop() -> None:
            recorder.stopping = True

        on_stop(stop)
        if sys.stdin.isatty():
            say("Reading events from the keyboard, one JSON object a line; Ctrl-D ends.")
        recorder.run(sys.stdin.fileno())
    for kind in refused:
        for text in kind.rest():
            tell(f"{kind.kept[0][1]} {text}")
    for text in recorder.order.warnings():
        tell(text)
    if as_json:
        print_json({
            "log": str(log), "recorded": recorder.recorded, "refused": recorder.refused,
            "problems": problems_to_json(refused),
        })  # fmt: skip
    else:
        say(
            f"{log}: {counted(recorder.recorded, 'event')} recorded"
            + (f", {counted(recorder.refused, 'line')} refused" if recorder.refused else "")
            + "."
        )
    if recorder.refused:
        raise typer.Exit(1)


run.__doc__ = f"{run.__doc__}\n{bag_options.MAPPING_HELP}"
