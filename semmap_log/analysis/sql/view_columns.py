"""What the views hold: their columns, in order, with what each means. Data only."""

from __future__ import annotations

from collections.abc import Mapping

from semmap_log.core.arrow.intervals import SEEN_SECONDS
from semmap_log.core.arrow.table_columns import COLUMNS, KIND, STATE, TIME, Column
from semmap_log.core.model.commits import NOTE_TEXTS
from semmap_log.core.model.meaning import FIELDS

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
"""Of a door at a moment; and its annotations, as a map."""

INTERVALS = (
    DOOR,
    DOOR_NAME,
    Column("since", TIME, "when the state began", nullable=False),
    Column("until", TIME, "when it ended; of the last: the log's end", nullable=False),
    Column("seconds", "float64", "how long it lasted", nullable=False),
    Column("state", STATE, "the state", nullable=False),
    Column("event", "int64", "number of the event that began it", nullable=False),
    Column("sightings", "int64", "how many events said so", nullable=False),
    Column("seen_seconds", "float64", SEEN_SECONDS, nullable=False),
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
"""Of each view but `events`, its columns."""

ANNOTATIONS = Column("annotations", "map", "what is said of it in words: key -> value")
"""The last column of doors."""

FUNCTIONS: Mapping[str, tuple[Column, ...]] = {
    "doors_at": DOORS,
    "doors_known_at": DOORS,
    "beliefs": BELIEFS,
}
"""Of what is asked about a moment."""
