"""Any bytes in, only values or our errors out."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.events import KIND_BY_NAME, field_names
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.building import read_building
from semmap_log.interop.formats.files.door_csv import read_door_csv
from semmap_log.interop.formats.files.map_server import read_map
from semmap_log.interop.formats.files.thesis_yaml import read_thesis_yaml
from semmap_log.interop.formats.json.event_json_reader import DoorLookup, parse_event_line
from semmap_log.interop.formats.parsing.foreign_file import FileOrder
from semmap_log.interop.importing.import_plan import Present
from semmap_log.interop.importing.importing_lines import plan_event_lines
from tests.interop.importing.nothing_stored import NothingStored, lines_of

EMPTY = Present(DoorMap({}, {}), frozenset())
READERS = {
    "thesis": read_thesis_yaml,
    "building": read_building,
    "map": read_map,
    "csv": lambda path: read_door_csv(path, tz="Europe/Vienna"),
    "windows": lambda path: read_door_csv(DOORS, windows=path, tz="Europe/Vienna"),
    "lines": lambda path: plan_event_lines(path, EMPTY, lines_of("UTC"), NothingStored(), now_ns=0),
}
DOORS = Path("doors.csv")

WORDS = [
    "1", "2", "0", "-1", "1e-3", ".nan", "1e400", "front", '"', "'", ":", ": ", ",", "\n", "\n  ",
    "\n    ", "- ", "[", "]", "{", "}", "#", "&a", "*a", "!", "position", "x", "y", "theta",
    "width", "status", "OPEN", "levels", "L1", "doors", "walls", "vertices", "measurements",
    "distance", "image", "resolution", "origin", "negate", "mode", "timestamp,door,state\n",
    "timestamp,door,state,accuracy\n", "door,start,end\n", "2026-03-01", "2026-03-29T02:30", "0.9",
    '{"kind": "DoorObserved", "door_id": 1, "state": "OPEN"}', '"kind"', "null", "NaN", "é", "\0",
]  # fmt: skip
word_salad = st.lists(st.sampled_from(WORDS), max_size=60).map(lambda w: "".join(w).encode())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("random")


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.binary(max_size=300) | word_salad)
def test_any_bytes_are_read_or_refused(folder, monkeypatch, name, data):
    """Noise, and words of the formats thrown together."""
    monkeypatch.chdir(folder)
    DOORS.write_text("timestamp,door,state\n2026-03-01,front,OPEN\n")
    path = folder / f"some.{name}"
    path.write_bytes(data)

    try:
        found = READERS[name](path)
    except FormatError as error:
        found = str(error)

    assert found is not None


LOOKUP = DoorLookup(lambda _: DoorId(1), lambda: DoorId(2), lambda _: 0, lambda _: 0)
KEYS = sorted({name for kind in KIND_BY_NAME.values() for name in field_names(kind)}
              | {"happened", "door", "accuracy", "at", "event", "recorded", "actor", "command_id",
                 "cells_zlib_base64", "height"})  # fmt: skip
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    | st.sampled_from(["OPEN", "2026-03-01", "@1"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner,
                                                               max_size=3),
    max_leaves=5,
)  # fmt: skip


@pytest.mark.slow
@settings(max_examples=200, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(sorted(KIND_BY_NAME)), st.dictionaries(st.sampled_from(KEYS), json_values))
def test_any_keys_and_values_are_an_event_or_refused(kind, values):
    """The right keys with any values."""
    text = json.dumps({"kind": kind} | values)

    try:
        found = type(parse_event_line(text, order=FileOrder("UTC"), lookup=LOOKUP).event).__name__
    except FormatError as error:
        found = str(error)

    assert found == kind or found.startswith("line:1: ")
