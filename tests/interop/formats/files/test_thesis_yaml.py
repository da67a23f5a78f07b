"""The thesis's door database, both ways."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.core.model.doors import MAX_DOOR_ID, NAN, Door, DoorId, DoorMap, DoorState, reduced
from semmap_log.errors import CommandError, FormatError
from semmap_log.interop.formats.files.thesis_yaml import (
    dump_thesis_yaml,
    parse_thesis_yaml,
)
from semmap_log.interop.formats.parsing.strict_yaml import parse_yaml

HERE = Path("doors.yaml")
FIGURE_4_1 = """\
3:
  position:
    x: 2.0
    y: 1.5
    theta: -0.1
  width: 0.9
  status: CLOSED
  closed_prob: 0.7
  open_prob: 1e-05
"""


def read(text):
    return parse_thesis_yaml(parse_yaml(text.encode(), HERE, takes_nan=True), HERE)


def door(door_id=3, x=2.0, **values):
    known = {"level": 0, "y": 1.5, "theta": -0.1, "width": 0.9, "state": DoorState.CLOSED,
             "prob_open": 1e-05, "prob_closed": 0.7} | values  # fmt: skip
    return Door(DoorId(door_id), x=x, **known)


def door_map(*doors):
    return DoorMap({found.door_id: found for found in doors}, {})


def test_the_schema_of_figure_4_1_reads():
    """All eight values of a door."""
    (found,) = read(FIGURE_4_1).doors

    assert (3, 2.0, 1.5, -0.1, 0.9) == (found.door_id, found.x, found.y, found.theta, found.width)
    assert (DoorState.CLOSED, 0.7, 1e-05) == (found.state, found.prob_closed, found.prob_open)
    assert DoorState.OPEN == read(FIGURE_4_1.replace("CLOSED", "Open")).doors[0].state


def test_the_schema_of_figure_4_1_is_written():
    """Byte for byte, as the thesis prints it."""
    assert (FIGURE_4_1, []) == dump_thesis_yaml(door_map(door()))


def test_an_empty_file_is_an_empty_database():
    """And an empty database is written as something that every reader takes for a mapping."""
    assert () == read("").doors
    assert () == read("{}").doors
    assert ("{}\n", []) == dump_thesis_yaml(door_map())


def test_what_is_left_out_is_not_given():
    """Neither status nor probabilities are needed."""
    (found,) = read("1:\n  position: {x: 0, y: 0, theta: 0}\n  width: 1\n").doors

    assert found.state is None
    assert math.isnan(found.prob_open)
    assert math.isnan(found.prob_closed)


@pytest.mark.parametrize("text", ["MOVING", "OFFLINE", "ajar", "1", ""])
def test_a_status_it_does_not_know_is_unknown_with_a_warning(text):
    """As the thesis's server has it (4.2.2); the warning names the line."""
    table = read(FIGURE_4_1.replace("CLOSED", text))

    assert DoorState.UNKNOWN == table.doors[0].state
    assert table.warnings[0].startswith(
        "doors.yaml:7: door 3: status: expected one of OPEN, CLOSED, UNKNOWN, got "
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("3:\n", "00:\n", "doors.yaml:1: expected a door's id, .* from 0 to .* got '00'"),
        ("3:\n", "-1:\n", "expected a door's id, .* got '-1'"),
        ("3:\n", "007:\n", "expected a door's id, .* got '007'"),
        ("3:\n", "front:\n", "expected a door's id, .* got 'front'"),
        ("3:\n", f"{MAX_DOOR_ID + 1}:\n", "expected a door's id"),
        ("3:\n", "3.0:\n", "expected a door's id"),
        ("    x: 2.0\n", "", "doors.yaml:3: door 3: position: expected the key x, got none"),
        ("    x: 2.0", "    x: far", "doors.yaml:3: door 3: position: x: expected a number"),
        ("    x: 2.0", "    x: 010", "write it without"),
        ("    x: 2.0", "    x: .nan", "doors.yaml:3: .* x: expected a finite number, got '.nan'"),
        ("  width: 0.9", "  width: .NaN", "doors.yaml:6: .* expected a finite number"),
        ("open_prob: 1e-05", "open_prob: .inf", "doors.yaml:9: expected a finite number"),
        ("    x: 2.0", "    x: '2'", "expected a number, got '2'"),
        ("    x: 2.0", "    x: true", "expected a number, got 'true'"),
        ("  width: 0.9\n", "", "door 3: expected the key width, got none"),
        ("width: 0.9", "width: -0.9", "doors.yaml:6: door 3: width: expected .* 0 or more"),
        ("open_prob: 1e-05", "open_prob: 1.01", "doors.yaml:9: .* expected a number from 0 to 1"),
        ("open_prob: 1e-05", "open_prob:", "open_prob: expected a number, got nothing"),
        (FIGURE_4_1, "image: hall.pgm\nresolution: 0.05\n", "expected a door's id, .* got 'image'"),
        ("3:\n", "map: hall\nfront:\n", "doors.yaml:2: expected a door's id, .* got 'front'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(old, new, message):
    """One mistake each in the figure's door."""
    assert old in FIGURE_4_1

    with pytest.raises(FormatError, match=message):
        read(FIGURE_4_1.replace(old, new))


@pytest.mark.parametrize("text", [".nan", ".NaN", "nan", "NaN", "'.nan'"])
def test_a_probability_that_is_no_number_is_none_with_a_warning(text):
    """As servers of others write one that they do not have; the warning names the line."""
    table = read(FIGURE_4_1.replace("1e-05", text))

    assert math.isnan(table.doors[0].prob_open)
    assert 0.7 == table.doors[0].prob_closed
    (warning,) = table.warnings
    said = text.strip("'")
    assert warning.startswith("doors.yaml:9: door 3: open_prob: expected a number from 0 to 1, got")
    assert warning.endswith(f"'{said}'; taken for none")


def test_what_others_say_of_a_door_is_kept_or_named():
    """Single values as annotations, in their own spelling; the rest is left out."""
    more = "  name: 010\n  rooms: [hall, office]\n  note:\n"
    more += "  open_porb: 0.3\n"
    text = "map: hall\n" + FIGURE_4_1.replace("theta: -0.1", "theta: -0.1\n    z: 1") + more
    table = read(text + FIGURE_4_1.replace("3:", "4:") + "  name: back\n")

    assert [{"name": "010", "open_porb": "0.3"}, {"name": "back"}] == [
        found.annotations for found in table.doors
    ]
    keys = "a door (expected position, width, status, closed_prob, open_prob)"
    assert [
        f"doors.yaml:15: the key 'open_porb' is unknown for {keys}; kept as an annotation",
    ] == list(table.warnings)
    assert [
        "doors.yaml:1: the key 'map' is no door's id",
        "doors.yaml:7: the key 'z' is unknown for a position (expected x, y, theta)",
        f"doors.yaml:13: the key 'rooms' is unknown for {keys}, and has no single value",
        f"doors.yaml:14: the key 'note' is unknown for {keys}, and has no single value",
    ] == list(table.left_out)


def test_a_door_twice_is_an_error_with_both_lines():
    """Other readers keep the last one without a word."""
    with pytest.raises(FormatError, match=r"doors.yaml:10: key '3'"):
        read(FIGURE_4_1 + FIGURE_4_1)


def test_ids_ascend_and_states_are_reduced():
    """MOVING and OFFLINE leave as UNKNOWN."""
    text, _ = dump_thesis_yaml(
        door_map(door(10, state=DoorState.MOVING), door(9, state=DoorState.OFFLINE), door(2))
    )

    table = read(text)
    assert [2, 9, 10] == [found.door_id for found in table.doors]
    assert [DoorState.CLOSED, DoorState.UNKNOWN, DoorState.UNKNOWN] == [
        found.state for found in table.doors
    ]
    assert () == table.warnings


def test_unplaced_doors_are_named_and_left_out():
    """The format needs a position; such a door needs no probabilities either."""
    unplaced = door(4, x=NAN, y=NAN, theta=NAN, width=NAN, prob_open=NAN,
                    annotations={"name": "cellar"})  # fmt: skip

    text, left_out = dump_thesis_yaml(door_map(door(), unplaced))

    assert FIGURE_4_1 == text
    assert ["door 4 (cellar): has no position, which this format needs"] == left_out


def test_doors_without_probabilities_are_named():
    """What to write for them is the user's to say."""
    doors = door_map(door(), door(4, prob_open=NAN), door(5, annotations={"name": "front"},
                                                           prob_closed=NAN))  # fmt: skip

    said = r"closed_prob is not given: door 5 \(front\); open_prob is not given: door 4\. .* P,"
    with pytest.raises(CommandError, match=said):
        dump_thesis_yaml(doors)
    text, _ = dump_thesis_yaml(doors, default_prob=0.25)
    assert [(0.7, 1e-05), (0.7, 0.25), (0.25, 1e-05)] == [
        (found.prob_closed, found.prob_open) for found in read(text).doors
    ]
    partial, left_out = dump_thesis_yaml(doors, is_partial=True)
    assert [0.7, 1e-05, 0.7, NAN, NAN, 1e-05] == pytest.approx(
        [p for found in read(partial).doors for p in (found.prob_closed, found.prob_open)],
        nan_ok=True,
    )
    assert said.partition(r"\.")[0].replace("\\", "") == "; ".join(left_out)
    with pytest.raises(CommandError, match="number from 0 to 1"):
        dump_thesis_yaml(doors, default_prob=NAN)


reals = st.floats(allow_nan=False, allow_infinity=False)
doors = st.builds(
    door,
    st.integers(0, MAX_DOOR_ID), reals, y=reals, theta=reals,
    width=st.floats(min_value=0, allow_infinity=False),
    state=st.sampled_from(DoorState), prob_open=st.floats(0, 1), prob_closed=st.floats(0, 1),
)  # fmt: skip


@given(st.lists(doors, unique_by=lambda found: found.door_id))
def test_values_survive_a_round_trip_exactly(found):
    """Every double comes back bit for bit, -0.0 and subnormals included."""
    table = read(dump_thesis_yaml(door_map(*found))[0])

    def values(one, state):
        return (one.door_id, *map(repr, (one.x, one.y, one.theta, one.width, one.prob_open,
                                         one.prob_closed)), state)  # fmt: skip

    expected = sorted(values(one, reduced(one.state)) for one in found)
    assert expected == [values(one, one.state) for one in table.doors]
