"""Foreign files into a log: each whole or not at all, and only once."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from semmap_log.analysis.costmap_2d.map_rules import RulesName
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.levels import resolve_level
from semmap_log.core.folds.rebasing import are_same
from semmap_log.core.io.disk import utf8_name
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import NO_CONTENT, Note
from semmap_log.core.model.doors import suspect_cells
from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import Moment
from semmap_log.errors import CommandError, FormatError
from semmap_log.interop.formats.bags.bag_reading import READABLE_BAGS, files_of, is_bag
from semmap_log.interop.formats.files import map_server
from semmap_log.interop.formats.files.building import read_building
from semmap_log.interop.formats.files.door_csv import read_door_csv
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor, TableForm
from semmap_log.interop.formats.files.thesis_yaml import read_thesis_yaml
from semmap_log.interop.formats.kept_scans.reading import kept_already
from semmap_log.interop.formats.kept_scans.writing import keeping_scans
from semmap_log.interop.formats.parsing.foreign_file import open_regular
from semmap_log.interop.importing import scan_topics
from semmap_log.interop.importing.as_recorded import append_as_recorded, with_room_names
from semmap_log.interop.importing.bag_importing import plan_bag
from semmap_log.interop.importing.held_sightings import HeldSightings, plan_sightings
from semmap_log.interop.importing.import_plan import Imported, ImportPlan, Present, plan_doors
from semmap_log.interop.importing.importing_lines import LinesPlan, plan_event_lines
from semmap_log.interop.importing.line_commits import LineOptions
from semmap_log.interop.importing.present_log import (
    append_lines,
    backdating,
    now_ns,
    present,
    stored_commits,
    with_backdated,
)
from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper
from semmap_log.interop.topics.mapping_file import read_mapping
from semmap_log.interop.topics.topic_rules import WELL_KNOWN, RosMapping
from semmap_log.log import DoorLog, DoorLogWriter

READABLE = (
    ".yaml (a building of Open-RMF, a map of map_server, the thesis's doors), .csv, .csv.gz, "
    f".jsonl, .jsonl.gz, {READABLE_BAGS}"
)

TOLD_EVERY = 1000
"""Events between two words of progress, or a whole batch of them."""


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """How a file is to be taken."""

    level: str | None = None
    """Building: only this level. Other files: the level of their doors, of the map, or of where the
    robot drove; None: the only one."""
    windows: Path | None = None
    """CSV: when the states are known at all."""
    tz: str | None = None
    """CSV, JSON lines: zone of times without an offset; None: the log's."""
    update: bool = False
    renumber: bool = False
    at_ns: int | None = None
    """When it happened, where the file does not say; None: when it is recorded."""
    since_ns: int | None = None
    """Doors of a building or a door database, and maps: from when on they are there, also those
    that the log has from a later time on; None: new ones from `at_ns`."""
    mapping: Path | None = None
    """Bags: how their topics are read; None: the well-known ones."""
    scan: scan_topics.ScanOptions | None = None
    """Bags: which lasers are read besides those that the mapping names."""
    map_rules: RulesName | None = None
    """Maps: the server whose cells the picture's pixels become; None: nav2."""
    as_recorded: bool = False
    """The times of the file are when it was known: it is recorded then, where the log's order
    allows that."""
    form: TableForm | None = None
    """How another system writes its door log, whatever the file is called; None: as our CSV."""
    accuracy: float | None = None
    """CSV: of rows without one, which are then sightings; None: they set the state."""
    new_doors: bool = False
    """CSV: names of no door are those of new ones, also in a log that has doors."""
    source: str = ""
    """Which sensor the file is of: its sightings are compared with that one's only; empty: a
    sighting that the log holds by any other file is the same."""


def import_file(
    log: DoorLogWriter,
    path: Path,
    options: ImportOptions = ImportOptions(),
    *,
    note: Note = Note(),
    keep_scans: bool = False,
    progress: Progress | None = None,
) -> Imported:
    """Import a file as one commit; JSON lines that a log wrote, as the commits they were there.

    Args:
        log: Where to.
        path: Its extension is its format.
        options: How to take it.
        note: Who and why; the source is the file's name unless given.
        keep_scans: Keep the scans of all visits next to the log, also of those imported before.
        progress: Called with (events written, events in all); of a bag first (messages read, in
            all).

    Raises:
        FormatError: The file cannot be read, or is of no known format.
        CommandError: The map forbids it.
        OutputError: The scans cannot be kept.
    """
    if options.mapping is not None and not is_bag(path):
        raise CommandError(f"{path}: --mapping is only for bags, and this is no bag.")
    if options.map_rules is not None and not map_server.is_map(path):
        raise CommandError(f"{path}: --map-rules is only for maps, and this is no map.")
    if options.scan is not None and not is_bag(path):
        raise CommandError(
            f"{path}: --scan is only for bags, and this is no bag ({READABLE_BAGS}). A "
            "topic needs its full name: --scan /scan."
        )
    found = _plan_scans(log, path, options, progress, keep_scans=keep_scans, actor=note.actor)
    if found is not None and options.as_recorded:
        raise CommandError(
            f"{path}: --as-recorded: what lasers saw is made of the scans now; import the bag's "
            "other topics, without --scan."
        )
    if found is not None:
        said = note if note.source else replace(note, source=utf8_name(path))
        count, first = scan_topics.append_with_scans(log, found, said)
        plan = ImportPlan(
            (), count, found.summary, found.left_out, found.warnings, nothing=found.nothing
        )
        return Imported(plan, first)
    _check_no_since(path, options)
    options = replace(options, source=note.source)
    command_id = None
    is_lines = options.form is None and is_event_lines(path)
    if is_lines or not (options.update or options.renumber):
        command_id = command_id_of(path, options)
        if log.find_command(command_id) is not None:
            return Imported(ImportPlan((), 0), None, known_before=True)
    if not note.source:
        note = replace(note, source=utf8_name(path))
    plan, lines = plan_file(log, path, options, note=note, progress=progress)
    if lines is not None:
        return Imported(plan, append_lines(log, lines, progress))
    if plan.count == 0:
        return Imported(plan, None)
    if options.as_recorded:
        first = append_as_recorded(
            log, path, plan, note=note, file_id=command_id or os.urandom(16), progress=progress
        )
        return Imported(plan, first)
    appended = log.append(
        _told(plan.events, plan.count, progress),
        note=note,
        command_id=command_id,
        content=command_id or NO_CONTENT,
    )
    return Imported(plan, appended.commit.last_event - plan.count + 1)


def plan_file(
    log: DoorLog, path: Path, options: ImportOptions, *, note: Note = Note(),
    progress: Progress | None = None,
) -> tuple[ImportPlan, LinesPlan | None]:  # fmt: skip
    """Return what a file would bring, a bag's scans aside; of JSON lines their commits, too.

    Nothing is written.

    Raises:
        FormatError: It cannot be read, is of no known format, or nothing of it can be imported.
        CommandError: The map forbids it, or an option is for other files.
    """
    _check_no_since(path, options)
    if options.form is None and is_event_lines(path):
        lines = _plan_lines(log, path, options, note, command_id_of(path, options))
        plan = ImportPlan(
            (), lines.count, lines.summary, left_out=lines.left_out, warnings=lines.warnings,
            nothing=lines.nothing,
        )  # fmt: skip
        check_not_empty(path, plan)
        return plan, lines
    plan_of = _planner(path, progress, has_form=options.form is not None)
    plan = plan_of(log, path, options)
    check_not_empty(path, plan)
    if options.since_ns is not None and plan_of is not _plan_map:
        plan = with_backdated(log, plan, options.since_ns)
    return plan, None


def _check_no_since(path: Path, options: ImportOptions) -> None:
    """Refuse `since` for a file whose events have times of their own.

    Raises:
        CommandError: `since` is given.
    """
    if options.since_ns is not None and not map_server.is_yaml(path):
        raise CommandError(
            f"{path}: its events say when they were; --since and --since-ever are about the doors "
            "of a building or a door database, and maps. For doors that are there, give no file."
        )


def check_not_empty(path: Path, plan: ImportPlan) -> None:
    """Return if a file has something that can be imported, or that the log holds.

    Raises:
        FormatError: It has not.
    """
    if plan.nothing:
        raise FormatError(path, f"nothing of it can be imported: {plan.nothing}")


Planner = Callable[[DoorLog, Path, ImportOptions], ImportPlan]


def plan_bag_import(
    log: DoorLog, path: Path, options: ImportOptions, progress: Progress | None = None
) -> ImportPlan:
    """Return what a bag would bring; nothing is written.

    Raises:
        FormatError: The bag or the mapping cannot be read.
        CommandError: The map forbids it; or an option says what of a bag only a mapping can.
    """
    mapping = mapping_of(path, options)
    return plan_bag(path, log, mapping, source=options.source, progress=progress)


def mapping_of(path: Path, options: ImportOptions) -> RosMapping:
    """Return how a bag's topics are read.

    Raises:
        FormatError: The mapping cannot be read.
        CommandError: An option says what of a bag only a mapping can.
    """
    since_ns = None if options.scan is None else options.since_ns
    mine = ImportOptions(
        level=options.level, tz=options.tz, mapping=options.mapping, scan=options.scan,
        since_ns=since_ns, source=options.source, new_doors=options.new_doors,
        as_recorded=options.as_recorded,
    )  # fmt: skip
    if options != mine:
        raise CommandError(
            f"{path}: a bag's messages say when they were, and a mapping says how they are read; "
            "leave out --windows, --at, --update, --renumber, --accuracy."
        )
    mapping = WELL_KNOWN if options.mapping is None else read_mapping(options.mapping)
    return mapping if options.level is None else replace(mapping, level=options.level)


def _plan_scans(
    log: DoorLogWriter, path: Path, options: ImportOptions, progress: Progress | None,
    *, keep_scans: bool, actor: str,
) -> scan_topics.ScanImport | None:  # fmt: skip
    """Return what a bag's scans would bring, kept or not; None: no laser is named.

    Raises:
        FormatError: The bag cannot be read, or no scan of it has a place on the map.
        CommandError: The map forbids it; or no laser is read whose scans could be kept.
        OutputError: The scans cannot be kept.
    """
    if not keep_scans:
        if not is_bag(path):
            return None
        return plan_scan_import(log, path, options, progress, actor=actor)
    with keeping_scans(log.path, log.info.log_id) as writer:
        keeper = ScanKeeper(writer, known=kept_already(log.path, log.info.log_id))
        try:
            found = None
            if is_bag(path):
                found = plan_scan_import(log, path, options, progress, keeper=keeper, actor=actor)
        except BaseException:
            writer.discard()
            raise
    if found is None:
        raise CommandError(f"{path}: --keep-scans keeps what lasers saw, and no laser is read: "
                           "name it with --scan, or in a mapping.")  # fmt: skip
    return found


def plan_scan_import(
    log: DoorLog, path: Path, options: ImportOptions, progress: Progress | None = None,
    *, keeper: ScanKeeper | None = None, actor: str = "",
) -> scan_topics.ScanImport | None:  # fmt: skip
    """Return what an import of a bag's scans would bring; None: no laser is named.

    Args:
        log: As it stands.
        path: The bag.
        options: How it is read.
        progress: Called with (messages read, messages in all).
        keeper: What keeps the scans of all visits; None: nobody does.
        actor: Who will be named as who saw it; "": the robot.

    Raises:
        FormatError: The bag cannot be read, or no scan of it has a place on the map.
        CommandError: The map forbids it; or no door was there at the time of the scans.
    """
    mapping = scan_topics.with_scans(path, mapping_of(path, options), options.scan)
    if not mapping.reads_scans:
        return None
    earlier, since_ns = ImportPlan((), 0), options.since_ns
    if since_ns is not None:
        earlier = backdating(log, list(log.replay().doors), since_ns)
    bag_id = command_id_of(path, ImportOptions())
    topics_id = command_id_of(path, replace(options, scan=None, since_ns=None))
    since_id = hashlib.sha256(bag_id + f"since {since_ns}".encode()).digest()[:16]
    return scan_topics.plan_with_scans(
        log, path, mapping, scan_topics.BagIds(bag_id, topics_id, since_id), earlier, keeper=keeper,
        progress=progress, actor=actor,
    )  # fmt: skip


def is_event_lines(path: Path) -> bool:
    """Return whether a name is that of a file of JSON lines."""
    return path.name.lower().removesuffix(".gz").endswith((".jsonl", ".ndjson"))


def _planner(path: Path, progress: Progress | None, *, has_form: bool) -> Planner:
    """Return what plans the import of a file."""
    if not has_form and is_bag(path):
        return lambda log, path, options: plan_bag_import(log, path, options, progress)
    if not has_form and map_server.is_yaml(path):
        by_kind: dict[map_server.YamlKind, Planner] = {
            "building": _plan_building, "map": _plan_map, "doors": plan_thesis_yaml,
        }  # fmt: skip
        return by_kind[map_server.kind_of_yaml(path)]
    if has_form or path.name.lower().removesuffix(".gz").endswith((".csv", ".tsv")):
        return _plan_csv
    raise FormatError(path, f"unknown extension for an import; expected one of: {READABLE}.")


def _plan_building(log: DoorLog, path: Path, options: ImportOptions) -> ImportPlan:
    table = with_room_names(read_building(path, level=options.level))
    return _plan_table(present(log), table, options)


def _plan_map(log: DoorLog, path: Path, options: ImportOptions) -> ImportPlan:
    """Return the floor plan that a map is, unless the level has it at that time already."""
    at_ns = options.at_ns if options.since_ns is None else options.since_ns
    doors = log.replay(at=Moment(ns=at_ns))
    now = log.door_map() if isinstance(log, DoorLogWriter) else log.replay()
    level = resolve_level(options.level, now)
    found = map_server.read_map(
        path, level=level, rules=options.map_rules or map_server.DEFAULT_RULES
    )
    there = log.floor_of(doors, level)
    if there is not None and are_same([found], [there]):
        return ImportPlan((), 0)
    height, width = found.cells.shape
    name = now.level_name(level)
    said = f"floor plan of level {name}: {width} x {height} cells of {found.resolution:.3g} m"
    suspect = suspect_cells(resolution=found.resolution, theta=found.origin_theta)
    return ImportPlan(
        (replace(found, happened_ns=at_ns),), 1, summary=(said,), warnings=tuple(suspect)
    )


def plan_thesis_yaml(log: DoorLog, path: Path, options: ImportOptions) -> ImportPlan:
    """Return what a thesis's YAML means for a log as it stands.

    Raises:
        FormatError: It cannot be read.
        CommandError: The map forbids it.
    """
    table = read_thesis_yaml(path)
    there = present(log)
    door_map = there.door_map

    def level_of(door: TableDoor) -> int:  # the format has no levels: a known door stays on its own
        assert door.door_id is not None  # the format's keys
        known = door_map.doors.get(door.door_id)
        removed = there.removed.get(door.door_id)
        if known is None and removed is not None and options.update:
            known = removed.door
        return known.level if known else resolve_level(options.level, door_map)

    placed = tuple(replace(door, level=level_of(door)) for door in table.doors)
    return _plan_table(there, replace(table, doors=placed), options)


def _plan_table(present: Present, table: DoorTable, options: ImportOptions) -> ImportPlan:
    return plan_doors(
        table,
        present,
        update=options.update,
        renumber=options.renumber,
        at_ns=options.at_ns,
        since_ns=options.since_ns,
    )


def _plan_csv(log: DoorLog, path: Path, options: ImportOptions) -> ImportPlan:
    zone = log.info.timezone if options.tz is None else options.tz
    sightings = read_door_csv(
        path, windows=options.windows, tz=zone, form=options.form, accuracy=options.accuracy
    )
    there = present(log)
    level = None if options.level is None else resolve_level(options.level, there.door_map)
    # A name that a removed door bore is that of a new one with `renumber`: then nothing is held.
    held = None if options.renumber else HeldSightings(log, source=options.source)
    return plan_sightings(
        sightings, there, held=held, level=level, renumber=options.renumber,
        new_doors=options.new_doors, hints_at_accuracy=_hints_at_accuracy(log, options),
    )  # fmt: skip


def _hints_at_accuracy(log: DoorLog, options: ImportOptions) -> bool:
    """Return whether it matters if states are set or seen, and no option says which they are."""
    is_of_changes = options.form is not None and options.form.reports_changes
    return log.info.holds != 0 and not is_of_changes


def _plan_lines(
    log: DoorLog, path: Path, options: ImportOptions, note: Note, command_id: bytes
) -> LinesPlan:
    zone = log.info.timezone if options.tz is None else options.tz
    taken = LineOptions(
        zone,
        command_id,
        note,
        log.info.timezone,
        source=options.source,
        at_ns=options.at_ns,
        as_recorded=options.as_recorded,
    )
    return plan_event_lines(
        path, present(log), taken, stored_commits(log), now_ns=now_ns(log),
        log=log,
    )  # fmt: skip


def command_id_of(path: Path, options: ImportOptions) -> bytes:
    """Return the id of an import's commit: the same for the same bytes taken in the same way."""
    since = "" if options.since_ns is None else f" since {options.since_ns}"
    source = f" source {options.source}" if options.source else ""
    form = f" form {_form_text(options.form)}" if options.form is not None else ""
    accuracy = f" accuracy {options.accuracy}" if options.accuracy is not None else ""
    how = f"import {options.level} {options.tz} {options.at_ns}{since}{source}{form}{accuracy}"
    whole = hashlib.sha256(how.encode())
    if options.map_rules is not None:
        whole.update(options.map_rules.encode())
    picture = map_server.picture_of(path) if map_server.is_map(path) else None
    if picture is not None and not picture.is_file():
        picture = None  # who reads the map says so
    for file in (path, options.windows, options.mapping, picture):
        for part in [] if file is None else files_of(file):
            whole.update(_digest(part))
    return whole.digest()[:16]


def _form_text(form: TableForm) -> str:
    """Return a form as a text that is the same for the same form."""
    line = "" if form.line is None else form.line.__name__
    states = sorted((word, state.name) for word, state in form.states.items())
    return repr((sorted(form.columns.items()), states, form.only, form.unit, line))


def _digest(path: Path) -> bytes:
    digest = hashlib.sha256()
    with open_regular(path) as file:
        while block := file.read(2**20):
            digest.update(block)
    return digest.digest()


def _told(
    events: Iterable[Event | EventBatch], count: int, progress: Progress | None
) -> Iterator[Event | EventBatch]:
    """Yield the events, and report how many there were."""
    done = told = 0
    for event in events:
        yield event
        done += len(event) if isinstance(event, EventBatch) else 1
        if progress is not None and done - told >= TOLD_EVERY:
            told = done
            progress(done, count)
