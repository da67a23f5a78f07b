"""One meaning, told once: what a new kind of event costs, and a new field of a door.

A copy of the sources gets a made-up one, in the few files that say what it means. Then every fold,
view, export and import is asked about it.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import semmap_log
from semmap_log.store.byte_layout import KINDS_OF_MINOR
from tests.newer.program import edit, run

MOST_FILES = 5

TOUCHED = '''
@dataclass(frozen=True, slots=True, kw_only=True)
class DoorTouched(DoorEvent):
    """Somebody touched a door, and felt how it is."""

    effect = Effect(sets=Changed.STATE, is_sighting=True)

    state: doors.DoorState
    accuracy_open: float = 1.0
    accuracy_closed: float = 1.0
    strength: float = doors.NAN
    touches: Annotated[int, field_rules.Whole(1, 200)] = 1
    gloved: bool = False


AnyEvent: TypeAlias = (
'''
TOUCHED_MSG = """\
# Somebody touched a door, and felt how it is.
uint32 door_id
uint8 state
float64 accuracy_open
float64 accuracy_closed
float64 strength  # of the touch [N]; NaN: not given
uint8 touches
bool gloved
"""

FELT = """\
        case events.DoorTouched():
            return f"felt {known.state.name}"
"""

APPEND_KIND = """
import sys
import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import DoorTouched

with sl.create(sys.argv[1], tz="UTC") as log:
    door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front", at="2026-03-01T12:00")
    happened_ns = log.instant("2026-03-01T13:00")
    log.append([DoorTouched(door_id=door, state=sl.DoorState.OPEN, happened_ns=happened_ns)])
    log.append(EventBatch.of(
        DoorTouched, door_id=[door, door], state=[2, 1], strength=[2.5, 3.5], accuracy_open=0.9,
        touches=[2, 200], gloved=[False, True],
        happened_ns=[happened_ns + 10**9, happened_ns + 2 * 10**9],
    ))
"""

COUNT_FRAMES = """
import sys
import semmap_log as sl
from semmap_log.analysis.costmaps.level_costmap import costmap_frames

with sl.read(sys.argv[1]) as log:
    print([frame.event for frame in costmap_frames(log)])
"""

FIELD_MSG = "float64 prob_closed  # [0, 1]; NaN: not given"
HEIGHT_MSG = f"{FIELD_MSG}\nfloat64 height       # of the frame [m]; NaN: not given"
LAST_FIELD = "    prob_closed: Annotated[Probability, Changed.PROB_CLOSED] = doors.NAN\n"
HEIGHT = (
    "    height: Annotated[float, field_rules.Number(0, or_nan=True), Changed.HEIGHT] = doors.NAN\n"
)

APPEND_FIELD = """
import sys
import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import Changed, DoorAdded, DoorUpdated

with sl.create(sys.argv[1], tz="UTC") as log:
    happened_ns = log.instant("2026-03-01T12:00")
    log.append([DoorAdded(
        door_id=1, x=1.0, y=2.0, theta=0.0, width=0.9, height=2.0, happened_ns=happened_ns,
    )])
    log.append(EventBatch.of(
        DoorUpdated, door_id=[1, 1], changed=int(Changed.HEIGHT), height=[2.5, 3.5],
        happened_ns=[happened_ns + 10**9, happened_ns + 2 * 10**9],
    ))
    log.annotate(1, "name", "front", at="2026-03-01T12:00:03")
"""


class Program:
    """A copy of the sources, and what was edited in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.package = folder / "semmap_log"
        shutil.copytree(
            Path(semmap_log.__file__).parent,
            self.package,
            ignore=shutil.ignore_patterns("__pycache__"),
        )
        self.edited: set[str] = set()

    def edit(self, name: str, *changes: tuple[str, str]) -> None:
        for old, new in changes:
            edit(self.package / name, old, new)
        self.edited.add(name)

    def verb(self, *words: object) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "semmap_log", *map(str, words)],
            env={**os.environ, "PYTHONPATH": str(self.folder), "COLUMNS": "200"},
            capture_output=True,
            text=True,
            check=False,
            cwd=self.folder,
        )
        assert not done.returncode, (words, done.stdout, done.stderr)
        return done.stdout

    def ask(self, *words: object) -> Any:
        return json.loads(self.verb(*words, "--json"))


@pytest.mark.slow
def test_a_kind_that_sets_the_state_is_told_in_five_files(tmp_path: Path) -> None:
    """Its message, its class, the format's minor version, its words."""
    program = Program(tmp_path / "program")
    (program.package / "core/messages/msg/DoorTouched.msg").write_text(
        TOUCHED_MSG, encoding="ascii"
    )
    program.edit(
        "core/model/events.py",
        ("\nAnyEvent: TypeAlias = (\n", TOUCHED),
        ("    | UnknownEvent\n)", "    | DoorTouched\n    | UnknownEvent\n)"),
    )
    counts = (*KINDS_OF_MINOR, KINDS_OF_MINOR[-1] + 1)
    program.edit("store/byte_layout.py", (f"_MINOR = {KINDS_OF_MINOR}", f"_MINOR = {counts}"))
    program.edit(
        "views/event_words.py",
        ("        case events.DoorRemoved():\n", FELT + "        case events.DoorRemoved():\n"),
    )
    assert len(program.edited) + 1 <= MOST_FILES
    log = tmp_path / "log"
    run(program.folder, APPEND_KIND, log)

    (door,) = program.ask("replay", log)["doors"]
    (then,) = program.ask("replay", log, "--at", "2026-03-01T13:00:01")["doors"]
    history = program.ask("history", log, "front")
    told = program.verb("history", log)
    intervals = program.ask("timeline", log, "front")
    found = program.ask("diff", log, "2026-03-01T12:30", "2026-03-01T13:00:01")
    believed = program.ask("probabilities", log, "front")

    assert ("OPEN", "CLOSED") == (door["state"], then["state"])
    states = [c["after"] for e in history for c in e["changes"] if c["field"] == "state"]
    assert ["UNKNOWN", "OPEN", "CLOSED", "OPEN"] == states
    assert told.count("felt OPEN") == 2
    assert "CLOSED" in json.dumps(intervals)
    assert "CLOSED" in json.dumps(found["changed"])
    assert [-1, 0, 2, 3, 4] == json.loads(run(program.folder, COUNT_FRAMES, log))
    assert 3 == _value(believed, "sightings")
    _leaves_and_comes_back(program, log, door, {
        "strength": {None, 2.5, 3.5}, "touches": {None, 1, 2, 200}, "gloved": {None, False, True},
    })  # fmt: skip
    rows = list(csv.reader((tmp_path / "x.csv").open()))
    assert ["OPEN", "CLOSED", "OPEN"] == [row[2] for row in rows[-3:]]


@pytest.mark.slow
def test_a_field_of_a_door_is_told_in_four_files(tmp_path: Path) -> None:
    """Two messages, the fields that events set, with the part that it is."""
    program = Program(tmp_path / "program")
    for kind in ("DoorAdded", "DoorUpdated"):
        program.edit(f"core/messages/msg/{kind}.msg", (FIELD_MSG, HEIGHT_MSG))
    program.edit(
        "core/model/meaning.py",
        ("    PROB_CLOSED = 16\n", "    PROB_CLOSED = 16\n    HEIGHT = 32\n"),
        (LAST_FIELD, LAST_FIELD + HEIGHT),
    )
    program.edit(
        "core/model/doors.py",
        ("    prob_closed: float\n", "    prob_closed: float\n    height: float = NAN\n"),
    )
    assert len(program.edited) == 4
    log = tmp_path / "log"
    run(program.folder, APPEND_FIELD, log)

    (door,) = program.ask("replay", log)["doors"]
    (then,) = program.ask("replay", log, "--at", "2026-03-01T12:00:01")["doors"]
    history = program.ask("history", log)
    found = program.ask("diff", log, "2026-03-01T12:00:01", "2026-03-01T12:00:02")

    assert (3.5, 2.5) == (door["height"], then["height"])
    heights = [(c["before"], c["after"]) for e in history for c in e["changes"]
               if c["field"] == "height"]  # fmt: skip
    assert [(None, 2.0), (2.0, 2.5), (2.5, 3.5)] == heights
    assert "height 2.5" in program.verb("history", log)
    assert "height" in json.dumps(found["changed"])
    _leaves_and_comes_back(program, log, door, {"height": {None, 2.0, 2.5, 3.5}})


def _leaves_and_comes_back(
    program: Program, log: Path, door: dict[str, Any], values: Mapping[str, set[Any]]
) -> None:
    """Export a log to every format, import what can come back, and look for columns."""
    import pyarrow.parquet as pq

    to, again = log.parent, log.parent / "again"
    for name in ("jsonl", "csv", "parquet", "geojson", "html", "rrd", "bag", "pgm", "pddl"):
        program.verb("export", log, to / f"x.{name}")
    program.verb("export", log, to / "x.yaml", "--default-prob", "0.5")
    program.verb("init", again, "--tz", "UTC")
    program.verb("import", again, to / "x.jsonl")
    program.verb("verify", again)
    program.verb("compact", again)

    assert [door] == program.ask("replay", again)["doors"]
    program.verb("export", again, to / "again.parquet")
    table, same = (pq.read_table(to / f"{name}.parquet").to_pydict() for name in ("x", "again"))
    assert values == {name: set(table[name]) for name in values}
    assert table == same


def _value(found: Any, key: str) -> Any:
    """Return the first value of that key, wherever it is."""
    if isinstance(found, dict):
        if key in found:
            return found[key]
        found = list(found.values())
    if isinstance(found, list):
        return next((value for one in found if (value := _value(one, key)) is not None), None)
    return None
