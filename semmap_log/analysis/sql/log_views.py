"""The views of a log: their columns, and their rows, made when a query scans them.

A scan reads only the parts of a log that the query's filter can match: its doors, its kinds, its
chunks. The views are `events`, what lasts and what was written (states of doors, rounds, poses,
changes, commits), and the doors at a moment with the beliefs about them.

DuckDB calls us on threads of its own, and passes on only the text of our errors. So an error is
kept here, as is whether anybody still waits for the rows.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import reduce
from itertools import islice, pairwise
from operator import and_
from typing import Any, TypeVar

import numpy as np

from semmap_log.analysis.beliefs import probabilities
from semmap_log.analysis.beliefs.door_beliefs import DoorBelief
from semmap_log.core.arrow import event_view, scanned_table
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.table import (
    COLUMNS,
    KIND,
    STATE,
    TIME,
    Column,
    schema_of,
    times_array,
    type_of,
)
from semmap_log.core.folds.history import ROUND_KINDS, HistoryEntry, Round, rounds
from semmap_log.core.model.commits import NOTE_TEXTS, Commit, Note
from semmap_log.core.model.doors import MAX_DOOR_ID, Door, DoorId, DoorMap, DoorState
from semmap_log.core.model.events import KINDS, RobotPose
from semmap_log.core.model.meaning import FIELDS
from semmap_log.core.model.moments import SECOND_NS, Time, parse_duration
from semmap_log.log import DoorLog, LogPart, Window, kinds_mask


def log_views(log: DoorLog, making: RowMaking) -> dict[str, scanned_table.ScannedTable]:
    """Return the views of a log, by name.

    Args:
        log: The log.
        making: Records errors while rows are made.
    """
    schemas = {name: query_schema(columns) for name, columns in VIEWS.items()}
    schemas |= {EVENTS: EVENT_SCHEMA, "doors": DOOR_SCHEMA}
    readers = _readers(log)
    return {
        name: scanned_table.ScannedTable(schema, making.tables(readers[name]))
        for name, schema in sorted(schemas.items())
    }


def _readers(log: DoorLog) -> dict[str, scanned_table.Read]:
    """Return the functions that make the rows of each view."""

    def doors(_: scanned_table.ScanRequest) -> Iterator[pa.Table]:
        yield door_table(log.replay())

    def intervals(asked: scanned_table.ScanRequest) -> Iterator[pa.Table]:
        ids = possible_doors(log, asked)
        return iter(()) if ids == [] else interval_tables(log, ids)

    def changes(asked: scanned_table.ScanRequest) -> Iterator[pa.Table]:
        ids = possible_doors(log, asked)
        for window in [] if ids == [] else possible_windows(log, asked):
            yield from change_tables(log, window, ids)

    def poses(asked: scanned_table.ScanRequest) -> Iterator[pa.Table]:
        for window in possible_windows(log, asked):
            yield from pose_tables(log, window)

    return {
        EVENTS: lambda asked: event_rows(log, asked),
        "doors": doors,
        "intervals": intervals,
        "changes": changes,
        "commits": lambda _: commit_tables(log),
        "patrols": lambda _: patrol_tables(log),
        "poses": poses,
    }


AT_ONCE = 10_000
"""Rows of a table."""


def query_schema(columns: Sequence[Column], *more: pa.Field) -> pa.Schema:
    """Return the schema that queries see: times in microseconds, as in SQL."""
    fields = [
        field.with_type(pa.timestamp("us", field.type.tz))
        if pa.types.is_timestamp(field.type)
        else field
        for field in schema_of(columns)
    ]
    return pa.schema([*fields, *more])


def rows_as_tables(columns: Sequence[Column], rows: Iterable[Sequence[Any]]) -> Iterator[pa.Table]:
    """Yield rows as tables: NaN becomes null, an instant is nanoseconds UTC.

    Args:
        columns: In the order of the rows' values.
        rows: Any number of rows; each table holds a part of them.
    """
    waiting = iter(rows)
    while part := list(islice(waiting, AT_ONCE)):
        yield rows_as_table(columns, part)


def rows_as_table(columns: Sequence[Column], rows: Sequence[Sequence[Any]]) -> pa.Table:
    """Return rows as one table: see `rows_as_tables`."""
    values = list(zip(*rows, strict=True)) or [()] * len(columns)
    arrays = [
        pa.array(each, type_of(column), from_pandas=True)
        for column, each in zip(columns, values, strict=True)
    ]
    return pa.Table.from_arrays(arrays, names=[column.name for column in columns])


EVENT_SCHEMA = query_schema(event_view.EVENT_VIEW)


def event_rows(log: DoorLog, asked: scanned_table.ScanRequest) -> Iterator[pa.Table]:
    """Yield the events that a filter can match, in any order."""
    needed, doors = event_view.history_columns(asked.columns), possible_doors(log, asked)
    windows = [] if doors == [] else possible_windows(log, asked)
    for table in log.unordered_tables(windows, needed, doors):
        yield event_view.as_event_view(table, asked.columns)


Tables = Iterator[pa.Table]


def interval_tables(log: DoorLog, doors: Collection[DoorId] | None) -> Tables:
    """Yield the states of doors that are, or were, in the map; None: of all."""
    names = log.door_names()
    found = log.timelines(doors)
    rows = (
        (door_id, names.get(door_id), each.start_ns, each.end_ns,
         each.duration_ns / SECOND_NS, each.state.name, each.event, each.sightings,
         each.seen_ns / SECOND_NS)
        for door_id, timeline in found.items()
        for each in timeline
    )  # fmt: skip
    return rows_as_tables(INTERVALS, rows)


def change_tables(log: DoorLog, window: Window, doors: Collection[DoorId] | None) -> Tables:
    """Yield what events changed, in the order of their numbers.

    Args:
        log: The log.
        window: Which events.
        doors: Only those about these; None: all.
    """
    names = log.door_names()
    rows = (row for entry in log.history_in(window, doors) for row in _change_rows(entry, names))
    return rows_as_tables(CHANGES, rows)


def commit_tables(log: DoorLog) -> Tables:
    """Yield the commits, in order."""
    return rows_as_tables(COMMITS, map(_commit_row, log.commits()))


def patrol_tables(log: DoorLog) -> Tables:
    """Yield the rounds, in the order of their first events."""
    return rows_as_tables(PATROLS, map(_round_row, rounds(log.history(kinds=ROUND_KINDS))))


def pose_tables(log: DoorLog, window: Window) -> Tables:
    """Yield the robot's poses, without retracted ones."""
    retractions = log.retractions()
    for batch in log.batches_in(window):
        seen = retractions.visible(batch)
        if RobotPose not in seen:
            continue
        rows, where = seen[RobotPose], seen.where(RobotPose)
        arrays = {
            "event": pa.array(seen.number[where]),
            "happened": times_array(seen.folds_ns[where]),
            "recorded": times_array(seen.recorded_ns[where]),
        }
        for column in POSES[len(arrays) :]:
            values = np.ascontiguousarray(rows[column.name])
            arrays[column.name] = pa.array(values, from_pandas=True)
        yield pa.table(arrays)


def _change_rows(entry: HistoryEntry, names: dict[DoorId, str]) -> Iterator[tuple[Any, ...]]:
    assert entry.door_id is not None or not entry.changes, "only doors change"
    for change in entry.changes:
        door_id = entry.door_id
        yield (
            entry.number, entry.kind, door_id, door_id and names.get(door_id),
            entry.folds_ns, entry.recorded_ns,
            change.field, _as_text(change.before), _as_text(change.after),
            entry.actor or None, entry.source or None, entry.reason or None,
            entry.correlation or None, entry.retracted,
        )  # fmt: skip


def _commit_row(commit: Commit) -> tuple[Any, ...]:
    return (
        commit.first_event, commit.last_event, commit.count,
        commit.recorded_ns, commit.wall_clock_ns, *_said(commit.note),
        commit.durability.name.lower(), commit.command_id.hex(), commit.hash.hex(),
    )  # fmt: skip


def _said(note: Note) -> Iterator[str | None]:
    return (getattr(note, name) or None for name in NOTE_TEXTS)


def _round_row(each: Round) -> tuple[Any, ...]:
    lasted = None
    if each.start_ns is not None and each.end_ns is not None:
        lasted = (each.end_ns - each.start_ns) / SECOND_NS
    return each.patrol, each.name or None, each.actor or None, each.start_ns, each.end_ns, lasted


def _as_text(value: Any) -> str | None:
    """Return a value as in JSON, without quotes; NaN is None."""
    if value is None or value != value:  # noqa: PLR0124 - NaN
        return None
    return value.name if isinstance(value, DoorState) else str(value)


_OF_EVENTS = {column.name: column for column in COLUMNS}

DOOR = Column("door_id", "uint32", "the door", nullable=False)
DOOR_NAME = Column("door_name", "str", "its name now")
LEVEL_NAME = Column("level_name", "str", "name of its level, else its number")
WHO_AND_WHY = tuple(Column(name, "str", "from the note of its commit") for name in NOTE_TEXTS)

DOORS = (
    DOOR,
    Column("name", "str", "its name then"),
    LEVEL_NAME,
    *(_OF_EVENTS[name] for name in FIELDS),
    Column("last_seen", TIME, "when its latest state happened"),
    Column("last_event", "int64", "number of the last event about it"),
)
"""The columns of a door at a moment, with its annotations as a map."""

INTERVALS = (
    DOOR,
    DOOR_NAME,
    Column("since", TIME, "when the state began", nullable=False),
    Column("until", TIME, "when it ended; of the last: the log's end", nullable=False),
    Column("seconds", "float64", "how long it lasted", nullable=False),
    Column("state", STATE, "the state", nullable=False),
    Column("event", "int64", "number of the event that began it", nullable=False),
    Column("sightings", "int64", "how many events said so", nullable=False),
    Column("seen_seconds", "float64", event_view.SEEN_SECONDS, nullable=False),
)

CHANGES = (
    Column("event", "int64", "number of the event that changed it", nullable=False),
    Column("kind", KIND, "kind of that event", nullable=False),
    DOOR,
    DOOR_NAME,
    Column("happened", TIME, "when it happened, never after recorded", nullable=False),
    Column("recorded", TIME, "when the log learnt it", nullable=False),
    Column("field", "str", "what changed: a field of the door, or a key of its annotations"),
    Column("before", "str", "its value before, as the log knew it then; null: none"),
    Column("after", "str", "its value since; null: none"),
    *WHO_AND_WHY,
    Column("retracted", "bool", "the event was taken back later", nullable=False),
)

COMMITS = (
    Column("first_event", "int64", "number of its first event", nullable=False),
    Column("last_event", "int64", "of its last event", nullable=False),
    Column("events", "int64", "how many it has", nullable=False),
    Column("recorded", TIME, "when the log learnt it", nullable=False),
    Column("wall_clock", TIME, "what the writer's clock showed", nullable=False),
    *WHO_AND_WHY,
    Column("durability", "str", "what was true when the append returned", nullable=False),
    Column("command_id", "str", "32 hex digits", nullable=False),
    Column("hash", "str", "its hash in the log's chain, 64 hex digits", nullable=False),
)

PATROLS = (
    Column("patrol", "uint32", "the round's number", nullable=False),
    Column("name", "str", "what it was for"),
    Column("actor", "str", "who drove"),
    Column("since", TIME, "when it began; null: nobody told"),
    Column("until", TIME, "when it ended; null: it goes on, or nobody told"),
    Column("seconds", "float64", "how long it took"),
)

POSES = (
    Column("event", "int64", "event number", nullable=False),
    Column("happened", TIME, "when the robot was there, never after recorded", nullable=False),
    Column("recorded", TIME, "when the log learnt it", nullable=False),
    *(_OF_EVENTS[name] for name in ("level", "x", "y", "theta", "sd_xy", "sd_theta")),
)

BELIEFS = (
    DOOR,
    Column("door_name", "str", "its name then"),
    LEVEL_NAME,
    Column("known_at", TIME, "up to when evidence counts", nullable=False),
    Column("moment", TIME, "the moment that the probability is of", nullable=False),
    Column("p_open", "float64", "P(open)", nullable=False),
    Column("low", "float64", "of its 90 % interval", nullable=False),
    Column("high", "float64", "the same", nullable=False),
    Column("p_closed", "float64", "P(closed)", nullable=False),
    Column("known", "bool", "false: too little evidence; the numbers are a guess", nullable=False),
    Column("estimator", "str", "the method", nullable=False),
    Column("sightings", "int64", "that saw it open or closed", nullable=False),
    Column("visits", "int64", "passes of a sensor, each counted once", nullable=False),
    Column("last_seen", TIME, "when it was last said to be open or closed"),
)

EVENTS = "events"

VIEWS: Mapping[str, tuple[Column, ...]] = {
    "doors": DOORS,
    "intervals": INTERVALS,
    "changes": CHANGES,
    "commits": COMMITS,
    "patrols": PATROLS,
    "poses": POSES,
}
"""The columns of each view but `events`."""

ANNOTATIONS = Column("annotations", "map", "what is said of it in words: key -> value")
"""The last column of doors."""

FUNCTIONS: Mapping[str, tuple[Column, ...]] = {
    "doors_at": DOORS,
    "doors_known_at": DOORS,
    "beliefs": BELIEFS,
}
"""The columns of each function of a moment."""


TEXTS = pa.map_(pa.string(), pa.string())

DOOR_SCHEMA = query_schema(DOORS, pa.field(ANNOTATIONS.name, TEXTS))
BELIEF_SCHEMA = query_schema(BELIEFS)


def door_table(door_map: DoorMap) -> pa.Table:
    """Return the doors of a map, ids ascending, by `DOOR_SCHEMA`."""
    doors = list(door_map.doors.values())
    table = rows_as_table(DOORS, [tuple(_door_row(door, door_map)) for door in doors])
    said = pa.array([list(door.annotations.items()) for door in doors], TEXTS)
    return table.append_column(ANNOTATIONS.name, said).cast(DOOR_SCHEMA, safe=False)


def belief_table(log: DoorLog, at: Time, horizon: str | None = None) -> pa.Table:
    """Return how likely each door is open, by `BELIEF_SCHEMA`.

    Args:
        log: The log of the doors.
        at: The moment of the query.
        horizon: How long after it, such as `2h`.

    Raises:
        MomentError: One of the two cannot be read.
    """
    horizon_ns = 0 if horizon is None else parse_duration(horizon)
    found = probabilities(log, at=at, horizon_ns=horizon_ns)
    return rows_as_table(BELIEFS, [_belief_row(one) for one in found]).cast(
        BELIEF_SCHEMA, safe=False
    )


def _door_row(door: Door, door_map: DoorMap) -> Iterator[Any]:
    yield from (door.door_id, door.name, door_map.level_name(door.level))
    for name in FIELDS:
        value = getattr(door, name)
        yield value.name if isinstance(value, DoorState) else value
    yield from (door.last_seen_ns, door.last_event)


def _belief_row(one: DoorBelief) -> tuple[Any, ...]:
    counts = one.evidence.counts
    return (
        one.door.door_id, one.door.name, one.level_name, one.known_ns, one.time_ns,
        one.p_open, one.low, one.high, one.p_closed, one.is_known,
        one.estimator, counts.sightings, counts.visits, counts.last_seen_ns,
    )  # fmt: skip


A = TypeVar("A")


class StoppedError(Exception):
    """The rows are no longer needed."""


class RowMaking:
    """Records errors in functions that make rows."""

    def __init__(self) -> None:
        self.failure: Exception | None = None
        """The last."""
        self._is_stopped = False

    def taken_failure(self) -> Exception | None:
        """Return the last error, once, since it holds frames again when raised."""
        failure, self.failure = self.failure, None
        return failure

    def stop(self) -> None:
        """Stop the functions that make tables before their next one."""
        self._is_stopped = True

    def noted(self, make: Callable[[A], pa.Table]) -> Callable[[A], pa.Table]:
        """Wrap a function that makes rows, to record its failures."""

        def made(asked: A) -> pa.Table:
            try:
                self._check_wanted()
                return make(asked)
            except Exception as error:  # noqa: BLE001 - reported by `failure`
                raise self._noted(error) from None

        return made

    def tables(self, read: scanned_table.Read) -> scanned_table.Read:
        """Wrap a function that yields tables, to record its failures."""

        def found(asked: scanned_table.ScanRequest) -> Iterator[pa.Table]:
            try:
                for table in read(asked):
                    self._check_wanted()
                    yield table
            except GeneratorExit:
                raise  # the query has all that it wants
            except Exception as error:  # noqa: BLE001 - reported by `failure`
                raise self._noted(error) from None

        return found

    def _noted(self, error: Exception) -> Exception:
        """Keep an error, and return what DuckDB sees of it.

        It is kept without its frames, which would hold DuckDB, and DuckDB us, for ever.
        """
        self.failure = error.with_traceback(None)
        error.__cause__ = error.__context__ = None
        return RuntimeError(f"{type(error).__name__}: {error}")

    def _check_wanted(self) -> None:
        """Check that the rows are still needed.

        Raises:
            StoppedError: They are not.
        """
        if self._is_stopped:
            raise StoppedError


MOST_DOORS = 16
"""So many are read one by one; for more, reading all events is faster."""

BOUNDED = ("event", "happened", "happened_ns", "recorded", "recorded_ns")
"""Columns by which parts of a log can be left out."""


def possible_doors(log: DoorLog, asked: scanned_table.ScanRequest) -> list[DoorId] | None:
    """Return the doors whose rows the filter can match; None: many, or rows about others, too."""
    names = [name for name in ("door_id", "door_name") if asked.filters_by(name)]
    if not names:
        return None
    called = log.all_door_names()
    ids = sorted(called)
    gaps = [(one + 1, other - 1) for one, other in pairwise([-1, *ids, MAX_DOOR_ID + 1])]
    strangers = [
        scanned_table.equal("door_id", None),
        *(_ids(*gap) for gap in gaps if gap[0] <= gap[1]),
    ]
    # A door that is called nothing here has no name at any time.
    if asked.possible([each & scanned_table.equal("door_name", None) for each in strangers]):
        return None
    pairs = [(door_id, name) for door_id in ids for name in [None, *sorted(called[door_id])]]
    places = asked.possible(
        [
            _ids(door_id, door_id) & scanned_table.equal("door_name", _text(name))
            for door_id, name in pairs
        ]
    )
    found = sorted({pairs[place][0] for place in places})
    return found if len(found) <= MOST_DOORS else None


def possible_windows(log: DoorLog, asked: scanned_table.ScanRequest) -> list[Window]:
    """Return the events that the filter can match, as ranges of numbers, and their kinds."""
    kinds = list(KINDS)
    if asked.filters_by("kind"):
        places = asked.possible(
            [scanned_table.equal("kind", _text(kind.__name__)) for kind in KINDS]
        )
        kinds = [KINDS[place] for place in places]
    bits = kinds_mask(kinds)
    if not kinds or not any(map(asked.filters_by, BOUNDED)):
        return [Window(kinds=bits)] if kinds else []
    segments = _possible_parts(log.parts(), asked)
    runs = [run for part in segments for run in _possible_parts(log.parts_within(part), asked)]
    return [
        Window(first_event=first, before_event=end, kinds=bits, only_kept=True)
        for first, end in _joined(runs)
    ]


def _ids(first: int, last: int) -> scanned_table.Guarantee:
    least, greatest = (pa.scalar(each, pa.uint32()) for each in (first, last))
    return (
        scanned_table.equal("door_id", least)
        if first == last
        else scanned_table.between("door_id", least, greatest)
    )


def _text(text: str | None) -> pa.Scalar | None:
    return None if text is None else pa.scalar(text)


def _possible_parts(parts: Iterable[LogPart], asked: scanned_table.ScanRequest) -> list[LogPart]:
    listed = list(parts)
    guarantees = [reduce(and_, _bounds(part, asked)) for part in listed]
    return [listed[place] for place in asked.possible(guarantees)]


def _bounds(part: LogPart, asked: scanned_table.ScanRequest) -> Iterator[scanned_table.Guarantee]:
    yield scanned_table.between("event", pa.scalar(part.first_event), pa.scalar(part.last_event))
    for name, (least, greatest) in (
        ("happened", part.happened_ns),
        ("recorded", part.recorded_ns),
    ):
        yield scanned_table.between(
            name, scanned_table.microseconds(least), scanned_table.microseconds(greatest)
        )
        if asked.has(f"{name}_ns"):
            yield scanned_table.between(f"{name}_ns", pa.scalar(least), pa.scalar(greatest))


def _joined(parts: Iterable[LogPart]) -> list[tuple[int, int]]:
    """Return half-open ranges of events; adjacent ones are joined."""
    found: list[tuple[int, int]] = []
    for part in parts:
        if found and found[-1][1] == part.first_event:
            found[-1] = found[-1][0], part.last_event + 1
        else:
            found.append((part.first_event, part.last_event + 1))
    return found
