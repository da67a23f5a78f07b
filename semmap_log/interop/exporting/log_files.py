"""A log's state or events as a file for other programs: written whole, or not at all.

The extension chooses the format. JSON lines have all that `import` needs to make the same log of
them. PDDL has the doors as a planner's problem. A bag has the log as a stream, for `rosbag play`
and `ros2 bag play`, RViz, Foxglove and Lichtblick.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from semmap_log.analysis.beliefs import probabilities
from semmap_log.analysis.costmaps import costmap_at
from semmap_log.core.batches.event_batch import EventBatch, happened_by
from semmap_log.core.folds.door_index import labels_of
from semmap_log.core.folds.levels import of_class, only_doors
from semmap_log.core.io.disk import atomic_file, check_outside_log, output_errors
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.moments import Moment, Time
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError, FormatError, UnknownLevelError
from semmap_log.interop.exporting.costmap_files import write_costmap
from semmap_log.interop.exporting.stream import StreamOptions, log_stream
from semmap_log.interop.formats.bags.bag_reading import bytes_of, new_bag, ros_version_of
from semmap_log.interop.formats.files import pddl
from semmap_log.interop.formats.files.door_csv import dump_door_csv, sighting_of
from semmap_log.interop.formats.files.geojson import dump_geojson
from semmap_log.interop.formats.files.thesis_yaml import dump_thesis_yaml
from semmap_log.interop.formats.json.door_json import line_to_json
from semmap_log.interop.formats.ros.door_messages import is_drawn
from semmap_log.log import DoorLog, Scope, Window

WRITABLE = (
    ".yaml (the thesis's door database), .geojson (doors), .csv (states), .jsonl or .parquet "
    "(events), .rrd (rerun), .html (a page), .pgm (a costmap, with its .yaml); over time .mcap, "
    ".bag (ROS 1) or, without an extension, a rosbag2 folder; .pddl (a planning problem)"
)


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written."""

    what: str
    """In words, such as `3 doors`."""
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    """What else to know of it."""


def export(
    log: DoorLog,
    out: Path,
    scope: Scope = Scope(),
    *,
    default_prob: float | None = None,
    wishes: pddl.Wishes = pddl.Wishes(),
    domain: Path | None = None,
    object_class: str | None = None,
    progress: Progress | None = None,
) -> Exported:
    """Write a file in the format of its extension; an old file of that name is replaced at once.

    Args:
        log: Where from.
        out: The file.
        scope: The moment of the state, or up to which events count.
        default_prob: Thesis YAML, PDDL: for doors without probabilities.
        wishes: PDDL: start, goal, and whether there are costs.
        domain: PDDL: a file for the domain, written next to the problem.
        object_class: GeoJSON, CSV: only objects of that class; None: all.
        progress: Called with how much has been read, where events are written.

    Raises:
        FormatError: The name has no known extension.
        MissingExtraError: The format needs a package that is not installed.
        CommandError: The format cannot hold a door; the message says what to do.
        CostmapError: `.pgm`: there is nothing to draw, or the floor map is turned.
        OutputError: The file cannot be written; what was there is whole.
    """
    writers: dict[str, Callable[[Path], Exported]] = {
        ".yaml": lambda path: _thesis_yaml(log, path, scope, default_prob),
        ".yml": lambda path: _thesis_yaml(log, path, scope, default_prob),
        ".geojson": lambda path: _geojson(log, path, scope, object_class),
        ".csv": lambda path: _csv(log, path, scope, object_class),
        ".jsonl": lambda path: _event_lines(log, path, scope, progress),
        ".parquet": lambda path: _parquet(log, path, scope, progress),
        ".rrd": lambda path: _rrd(log, path, scope),
        ".html": lambda path: _html(log, path, scope, progress),
        ".pddl": lambda path: _pddl(
            log, path, scope, wishes, default_prob=default_prob, progress=progress
        ),
    }
    check_outside_log(log.path, out)
    if out.suffix == ".pgm":
        return _ros_map(log, out, scope)  # two files, which it puts in place together
    writer = writers.get(out.suffix.lower())
    if writer is None:
        raise FormatError(out, f"unknown extension for an export; expected one of: {WRITABLE}.")
    with ExitStack() as files:
        if domain is not None:
            _write_domain(files, log, domain, out, wishes)
        with output_errors(out), atomic_file(out) as temporary:
            return writer(temporary)


def _write_domain(
    files: ExitStack, log: DoorLog, domain: Path, problem: Path, wishes: pddl.Wishes
) -> None:
    """Write the domain of planning problems; it takes its name when the problem has its own."""
    check_outside_log(log.path, domain)
    if domain.resolve() == problem.resolve():
        raise CommandError(f"{domain}: expected two files, one for the domain, got one.")
    files.enter_context(output_errors(domain))
    temporary = files.enter_context(atomic_file(domain))
    temporary.write_text(pddl.dump_domain(with_costs=wishes.with_costs), encoding="ascii")


def _pddl(
    log: DoorLog,
    path: Path,
    scope: Scope,
    wishes: pddl.Wishes,
    *,
    default_prob: float | None,
    progress: Progress | None,
) -> Exported:
    made = planning_problem(
        log, scope, wishes, about(log), default_prob=default_prob, progress=progress
    )
    path.write_text(made.text, encoding="ascii")
    what = f"{counted(made.doors, 'door')}, {counted(made.rooms, 'room')}"
    return Exported(what, notes=made.notes)


def _thesis_yaml(log: DoorLog, path: Path, scope: Scope, default_prob: float | None) -> Exported:
    door_map = log.replay(scope.at_ns, scope.known_at_ns, scope.event)
    text, left_out = dump_thesis_yaml(door_map, default_prob=default_prob)
    path.write_text(text, encoding="utf-8")
    return Exported(counted(len(door_map.doors) - len(left_out), "door"), tuple(left_out))


def _geojson(log: DoorLog, path: Path, scope: Scope, object_class: str | None) -> Exported:
    door_map = log.replay(scope.at_ns, scope.known_at_ns, scope.event)
    if object_class is not None:
        door_map = of_class(door_map, object_class)
    text, unplaced = dump_geojson(door_map, about(log))
    path.write_text(text, encoding="utf-8")
    labels = labels_of(door_map)
    notes = tuple(
        f"{labels.get(door.door_id, door.label)}: without a place, so its geometry is null"
        for door in unplaced
    )
    doors = counted(len(door_map.doors), "door")
    return Exported(f"{doors}, in metres of the map frame", notes=notes)


def about(log: DoorLog) -> dict[str, str]:
    """Return what a file may say of the log that it is of."""
    info = log.info
    return {
        "log_id": info.log_id,
        "timezone": info.timezone,
        "building": info.building,
        "robot": info.robot,
    }


def _event_lines(log: DoorLog, path: Path, scope: Scope, progress: Progress | None) -> Exported:
    written = write_event_lines(log, path, scope, progress=progress)
    taken_back = f", {written.retracted:,} of them retracted" if written.retracted else ""
    what = f"{counted(written.events, 'event')}{taken_back}"
    begins = (
        f"history begins at event {log.horizon()}; of what was before, only the last values are "
        "exported. A log made of this file has no horizon: ask it about nothing earlier."
    )
    return Exported(what, notes=(begins,) if log.horizon() else ())


def _parquet(log: DoorLog, path: Path, scope: Scope, progress: Progress | None) -> Exported:
    from semmap_log.core.arrow.history_table import EXPORT_SCHEMA
    from semmap_log.core.arrow.parquet import write_parquet

    limit = log.limit_of(scope)
    window = Window.up_to(at_ns=scope.at_ns, event=limit)
    tables = log.tables_in(window, limit=limit, progress=progress)
    stored = (table.cast(EXPORT_SCHEMA) for table in tables)
    said = {f"semmap_log.{key}": text for key, text in about(log).items()}
    what = counted(write_parquet(path, stored, EXPORT_SCHEMA, said), "event")
    lacking = (
        f"the state of doors at event {log.horizon()}, where history begins, is in no event: a "
        "reader of this file knows a door's state only from its next event on."
    )
    return Exported(what, notes=(lacking,) if log.horizon() else ())


def _csv(log: DoorLog, path: Path, scope: Scope, object_class: str | None) -> Exported:
    doors = None if object_class is None else log.ids_of_class(object_class)
    names = _names(log.replay(scope.at_ns, scope.known_at_ns, scope.event))
    rows = []
    for batch in log.visible_batches(scope, doors=doors):
        for recorded, happened_ns in zip(batch, batch.folds_ns.tolist(), strict=True):
            door_id = getattr(recorded.event, "door_id", 0)
            row = sighting_of(
                recorded.event, happened_ns=happened_ns, door=names.get(door_id, str(door_id))
            )
            if row is not None:
                rows.append(row)
    rows.sort(key=lambda row: row.happened_ns)
    with path.open("w", encoding="utf-8") as file:
        file.writelines(dump_door_csv(rows, tz=log.info.timezone))
    return Exported(counted(len(rows), "row"))


def _ros_map(log: DoorLog, out: Path, scope: Scope) -> Exported:
    try:
        costmap = costmap_at(log, at=scope.at_ns, known_at=scope.known_at_ns, event=scope.event)
    except UnknownLevelError as error:
        raise UnknownLevelError(f"{error} `costmap` does it, with --level.") from None
    made = write_costmap(log, costmap, out, scope=scope)
    labels = labels_of(costmap.doors)
    left_out = tuple(
        f"{labels.get(door.door_id, door.label)}: {why}" for door, why in made.left_out
    )
    return Exported(f"a costmap of {counted(len(made.doors), 'door')}", left_out)


def _names(door_map: DoorMap) -> dict[int, str]:
    """Return what each door is called: by its name, with its level where two bear the same."""
    borne = Counter(door.name for door in door_map.doors.values())
    return {
        door.door_id: (
            door.name if borne[door.name] == 1 else f"{door_map.level_name(door.level)}/{door.name}"
        )
        for door in door_map.doors.values()
        if door.name
    }


def _rrd(log: DoorLog, path: Path, scope: Scope) -> Exported:
    from semmap_log.interop.formats.kept_scans.reading import kept_visits
    from semmap_log.views.rerun.recording import save_rrd

    if scope.known_at_ns is not None or scope.event is not None:
        raise CommandError("a recording shows all that is known: leave --known-at and --event out.")
    until = None if scope.at_ns is None else scope.at_ns + 1
    summary = save_rrd(log, path, until=until, scans=kept_visits)
    return Exported(counted(summary.events, "event"))


def _html(log: DoorLog, path: Path, scope: Scope, progress: Progress | None) -> Exported:
    from semmap_log.views.report.content import report

    if scope.known_at_ns is not None or scope.event is not None:
        raise CommandError("a page shows all that is known: leave --known-at and --event out.")
    until = None if scope.at_ns is None else scope.at_ns + 1
    made = report(log, until=until, progress=progress)
    path.write_text(made.html, encoding="utf-8")
    return Exported(f"{counted(made.doors, 'door')}, {counted(made.events, 'event')}")


TOLD_EVERY = 1000
"""Commits between two words of progress."""


@dataclass(slots=True)
class WrittenLines:
    """How much was written."""

    events: int = 0
    retracted: int = 0
    """So many of them were taken back, by what is known in the scope."""


def write_event_lines(
    log: DoorLog,
    path: Path,
    scope: Scope,
    *,
    progress: Progress | None = None,
) -> WrittenLines:
    """Write the events of a scope, numbers ascending, retracted ones marked.

    A retraction counts whenever it happened, as it does for every question about the scope. The
    first line also has the log's time zone. Events that stand for removed ones are written, too: a
    log that is made of the lines answers as this one does, from its horizon on.

    Args:
        log: The log.
        path: The file.
        scope: Which events.
        progress: Called with how many of the events are done.

    Raises:
        HorizonError: The scope ends before the log's horizon.
    """
    retractions = log.retractions(log.limit_of(scope))
    written, zone = WrittenLines(), {"timezone": log.info.timezone}
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for batch, commit_of in _told(log, scope, progress):
            hidden = retractions.hidden(batch).tolist()
            for recorded, retracted in zip(batch, hidden, strict=True):
                commit = commit_of(recorded.number)
                file.write(_line(zone | line_to_json(recorded, commit, retracted=retracted)))
                zone = {}
                written.events += 1
                written.retracted += retracted
    return written


CommitOf = Callable[[int], Commit]
"""Returns the commit of an event, by its number."""


def _told(
    log: DoorLog, scope: Scope, progress: Progress | None
) -> Iterator[tuple[EventBatch, CommitOf]]:
    """Yield what is exported: in large batches if the log has all events, which is quicker."""
    if not log.horizon():
        finder, limit = log.commit_finder(), log.limit_of(scope)
        if limit is None or limit >= 0:
            window = Window.up_to(at_ns=None, event=limit)
            for batch in log.batches_in(window, progress=progress, on_page=finder.look_at):
                chosen = batch if scope.at_ns is None else happened_by(batch, scope.at_ns)
                yield chosen, finder.commit_at
        return
    total = log.last_event() + 1
    for place, followed in enumerate(log.kept_commits(scope)):
        yield followed.batch, partial(_that, followed.commit)
        if progress is not None and place % TOLD_EVERY == 0:
            progress(followed.commit.last_event, total)


def _that(commit: Commit, _: int) -> Commit:
    return commit


def _line(shown: dict[str, Any]) -> str:
    return json.dumps(shown, ensure_ascii=False, allow_nan=False) + "\n"


MOST_NAMED = 2
"""So many doors are named in a note."""


@dataclass(frozen=True, slots=True)
class PlanningProblem:
    """The text of a problem, and what to know of it."""

    text: str
    doors: int
    rooms: int
    notes: tuple[str, ...]


def planning_problem(
    log: DoorLog,
    scope: Scope,
    wishes: pddl.Wishes,
    about: Mapping[str, str],
    *,
    default_prob: float | None = None,
    progress: Progress | None = None,
) -> PlanningProblem:
    """Return the doors of a moment as a PDDL problem: what they were, and how likely open.

    Args:
        log: Whose doors.
        scope: The moment. How likely a door is open is learnt from what counts then, as
            `probabilities` does it.
        wishes: Start, goal, costs.
        about: Facts about the log.
        default_prob: P(open) of doors of which too little was seen; None: what that little says.
        progress: Called with how much has been read.

    Raises:
        CommandError: There is no such room or door, or the goal is no PDDL.
        MomentError: The moment is before the log's first.
    """
    if default_prob is not None and not 0 <= default_prob <= 1:
        raise CommandError(f"--default-prob: expected a number from 0 to 1, got {default_prob!r}.")
    door_map = only_doors(log.replay(scope.at_ns, scope.known_at_ns, scope.event))
    problem = pddl.PddlProblem.of(door_map)
    likely = _likely(log, scope, door_map, default_prob, progress) if len(door_map) else {}
    text = problem.dump(likely, about, wishes)
    notes = (
        _unknown(door_map, likely, default_prob) if wishes.with_costs else "",
        _without_rooms(door_map),
        "no goal: --goal ROOM, DOOR or a condition" if wishes.goal is None else "",
        "no start: --start ROOM says where the robot is"
        if wishes.start is None and problem.room_names
        else "",
    )
    told = tuple(note for note in notes if note)
    return PlanningProblem(text, len(door_map), len(problem.room_names), told)


def _likely(
    log: DoorLog,
    scope: Scope,
    door_map: DoorMap,
    default_prob: float | None,
    progress: Progress | None,
) -> dict[DoorId, pddl.Likely]:
    known_at = Moment(ns=scope.known_at_ns)
    if scope.event is not None:
        known_at = Moment(event=log.limit_of(scope))
    believed = probabilities(
        log,
        at=Moment(ns=door_map.moment_ns),  # the last event's, if an event was given
        known_at=known_at,
        doors=list(door_map.doors),
        progress=progress,
    )
    return {
        each.door.door_id: pddl.Likely(
            default_prob if not each.is_known and default_prob is not None else each.p_open,
            each.is_known,
        )
        for each in believed
    }


def _unknown(
    door_map: DoorMap, likely: Mapping[DoorId, pddl.Likely], default_prob: float | None
) -> str:
    """Say of which doors too little was seen; "": none."""
    unknown = [door_id for door_id, each in likely.items() if not each.is_known]
    if not unknown:
        return ""
    named = f"{counted(len(unknown), 'door')} ({_named(door_map, unknown)})"
    if default_prob is not None:
        return f"P(open) of {named} is {default_prob:g}, by --default-prob"
    return f"P(open) of {named} rests on too little; --default-prob P sets one"


def _without_rooms(door_map: DoorMap) -> str:
    """Say which doors lead nowhere; "": none."""
    alone = [door.door_id for door in door_map.doors.values() if pddl.rooms_between(door) is None]
    if not alone:
        return ""
    return (
        f"no way leads through {counted(len(alone), 'door')} without two rooms "
        f"({_named(door_map, alone)}); to name them: annotate LOG DOOR rooms lobby,corridor"
    )


def _named(door_map: DoorMap, doors: Sequence[DoorId]) -> str:
    labels = labels_of(door_map)
    return _listed(labels.get(door_id, f"door {door_id}") for door_id in doors)


def _listed(words: Iterable[str]) -> str:
    first = list(islice(words, MOST_NAMED + 1))
    return ", ".join([*first[:MOST_NAMED], *(["…"] if len(first) > MOST_NAMED else [])])


@dataclass(frozen=True, slots=True)
class RecordedBag:
    """What was written."""

    messages: dict[str, int]
    """Topic -> how many."""
    every_s: float
    """See `StreamOptions`."""
    left_out: tuple[str, ...]
    """Doors that have no place at the end, and so are not shown."""
    bytes: int


def record_bag(
    log: DoorLog,
    out: Path,
    options: StreamOptions = StreamOptions(),
    *,
    since: Time = None,
    until: Time = None,
    progress: Progress | None = None,
) -> RecordedBag:
    """Write the bag, whole or not at all; the same log and options give the same bytes.

    Args:
        log: The log.
        out: `.mcap`, `.bag` (ROS 1) or, without an extension, a rosbag2 folder. A file that was
            there is replaced, a folder never.
        options: What is exported, and how.
        since: The first messages show this moment; default: the first event's, or the horizon.
        until: The last moment; default: the log's end.
        progress: Called with how many of the events are done.

    Raises:
        FormatError: The name is not that of a bag.
        MomentError: `since` comes after `until`.
        OutputError: It cannot be written, or a time cannot be a ROS stamp; what was there is whole.
    """
    check_outside_log(log.path, out)
    stream = log_stream(log, options, ros_version=ros_version_of(out), since=since, until=until)
    counts = Counter({topic.name: 0 for topic in stream.topics})
    with new_bag(out, stream.topics) as bag:
        for message in stream.messages(progress):
            bag.write_encoded(message.topic, message.at_ns, message.data)
            counts[message.topic.name] += 1
    left_out = _left_out(log, log.instant(until))
    return RecordedBag(dict(counts), stream.plan.every_s, left_out, bytes_of(out))


def _left_out(log: DoorLog, until_ns: int | None) -> tuple[str, ...]:
    door_map = log.replay(at=until_ns)
    labels = labels_of(door_map)
    doors = door_map.doors.values()
    return tuple(labels.get(door.door_id, door.label) for door in doors if not is_drawn(door))
