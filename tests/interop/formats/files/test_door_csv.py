"""Door logs as CSV: rows, sightings, windows, changes of clocks, and the real sets."""

import gzip
import math
import random

import numpy as np
import pytest

from semmap_log.core.model.doors import NAN, DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
)
from semmap_log.core.model.moments import format_wall, parse_instant
from semmap_log.errors import FormatError, MomentError
from semmap_log.interop.formats.files.csv_blocks import CsvBlocks
from semmap_log.interop.formats.files.door_csv import (
    Sighting,
    dump_door_csv,
    read_door_csv,
    sighting_of,
)

VIENNA = "Europe/Vienna"


def written(tmp_path, text, name="doors.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def read(tmp_path, rows, windows=None, header="timestamp,door,state", tz=VIENNA):
    """Return (wall clock, door, state, accuracy or None) of each row read."""
    path = written(tmp_path, f"{header}\n{rows}")
    other = None if windows is None else written(tmp_path, f"door,start,end\n{windows}", "w.csv")
    return [
        (format_wall(ns, tz), door, state.name, None if math.isnan(accuracy) else accuracy)
        for ns, door, state, accuracy in read_door_csv(path, windows=other, tz=tz)
    ]


@pytest.mark.parametrize("quote", ["", '"'], ids=["whole blocks", "row by row"])
@pytest.mark.parametrize("header", ["timestamp,door,state", "timestamp,door,state,accuracy"])
def test_rows_without_an_accuracy_are_sightings_of_the_one_that_is_given(tmp_path, header, quote):
    """One that a row has wins; a state that a window's edge gives stays an update."""
    own = ",0.7" if header.endswith("accuracy") else ""
    rows = f"2026-03-01T12:00,{quote}front{quote},open{own}\n"
    rows += f"2026-03-01T13:00,front,closed{',' if own else ''}\n"
    path = written(tmp_path, f"{header}\n{rows}")
    window = "door,start,end\nfront,2026-03-01T11:00,2026-03-01T14:00\n"

    read_plain = read_door_csv(path, tz=VIENNA, accuracy=0.9)
    read_windows = read_door_csv(path, windows=written(tmp_path, window, "w.csv"), tz=VIENNA,
                                 accuracy=0.9)  # fmt: skip

    assert [0.7 if own else 0.9, 0.9] == read_plain.accuracy.tolist()
    seen = [math.isnan(accuracy) for *_, accuracy in read_windows]
    assert [False, False, True] == seen[-3:]


def test_rows_with_an_accuracy_are_sightings(tmp_path):
    """Those without are updates; columns are found by name."""
    rows = "OPEN,0.9,front,2026-03-01T12:00\nclosed,,front,2026-03-01T13:00Z\n"

    assert [
        ("2026-03-01T12:00:00+01:00", "front", "OPEN", 0.9),
        ("2026-03-01T14:00:00+01:00", "front", "CLOSED", None),
    ] == read(tmp_path, rows, header="state,accuracy,door,timestamp")


def test_names_are_kept_as_they_are(tmp_path):
    """Slashes, commas, spaces, quotes, line breaks, many scripts."""
    names = [" a", "a\xa0", " =1 ", "/dev/tal", "a, b", ' "c" ', "Küche\nunten", "ハッカー", "π 3"]
    rows = [Sighting(i * 10**9, name, DoorState.OPEN, NAN) for i, name in enumerate(names)]
    path = written(tmp_path, "".join(dump_door_csv(rows, tz="UTC")))

    assert tuple(names) == read_door_csv(path, tz="UTC").doors


def test_gzip_is_known_by_its_content(tmp_path):
    """Whatever the file is called."""
    path = written(tmp_path, gzip.compress(b"timestamp,door,state\n2026-03-01,a,OPEN\n"))

    assert 1 == len(read_door_csv(path, tz="UTC"))


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("2026-03-01,a,AJAR", "doors.csv:2: state: expected one of UNKNOWN OPEN CLOSED MOVING"),
        ("2026-03-41,a,OPEN", "doors.csv:2: '2026-03-41' is not a time: day is out of range"),
        ("soon,a,OPEN", "doors.csv:2: Expected a time such as .* got 'soon'"),
        ("now,a,OPEN", "Expected a time"),
        ("1772434800,a,OPEN", "or @1772373720; got '1772434800'. --time-unit says what a number"),
        ("2026-03-01,a", "doors.csv:2: expected 3 cells as in the header, got 2"),
        ("2026-03-01,,OPEN", "expected a door's name, .* got ''"),
        ("2026-03-01, ,OPEN", "expected a door's name"),
        ("2026-03-02,a,OPEN\n2026-03-02,b,OPEN\n2026-03-01,a,OPEN",
         "doors.csv:4: expected a door's times not to run backwards, .*2026-03-02T00:00:00"),
        ('2026-03-01,"a,OPEN', "doors.csv:.: not CSV: unexpected end of data"),
        ('2026-03-01,"a"b,OPEN', "doors.csv:2: not CSV"),
        ("2026-03-01,a,OPEN\n" + "x" * 70_000, "doors.csv:3: expected lines of at most 65,536"),
        ("2026-03-01,a,OPEN\n2026-03-01,\udcff,OPEN", "doors.csv:3: expected UTF-8 text"),
        ("2026-03-29T02:30,a,OPEN", "doors.csv:2: .* the clocks of Europe/Vienna skip this hour"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(tmp_path, rows, message):
    """One bad row each."""
    path = tmp_path / "doors.csv"
    path.write_text(f"timestamp,door,state\n{rows}\n", errors="surrogateescape")

    with pytest.raises(FormatError, match=message):
        read_door_csv(path, tz=VIENNA)


@pytest.mark.parametrize("accuracy", ["0.4", "1.1", "nan", "high"])
def test_an_accuracy_is_half_to_one(tmp_path, accuracy):
    """Below one half the sensor would be read the other way round."""
    with pytest.raises(FormatError, match=r"number from 0.5 to 1"):
        read(tmp_path, f"2026-03-01,a,OPEN,{accuracy}", header="timestamp,door,state,accuracy")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a header timestamp,door,state, got an empty file"),
        ("timestamp,door\n", r"doors.csv:1: expected a header timestamp,door,state\[,accuracy\]"),
        ("timestamp,door,state,colour\n", "got 'timestamp,door,state,colour'"),
        ("timestamp,door,door,state\n", "got 'timestamp,door,door,state'"),
        ("2026-03-01,a,OPEN\n", "expected a header"),
        (
            gzip.compress(b"timestamp,door,state\n" + b"x" * 99, mtime=0)[:-20],
            "cannot be read on: ",
        ),
        (b"\x1f\x8b" + b"\0" * 40, "cannot be read on: "),
        (b"PK\x03\x04\xff\xff", "expected UTF-8 text, got byte 0xff"),
    ],
)
def test_what_is_no_door_csv_is_said(tmp_path, text, message):
    """No header, another header, another file, a torn one."""
    with pytest.raises(FormatError, match=message):
        read_door_csv(written(tmp_path, text), tz=VIENNA)


def test_an_unknown_zone_is_said(tmp_path):
    """Before the file is read."""
    with pytest.raises(MomentError, match="No time zone 'Wien'"):
        read_door_csv(tmp_path / "doors.csv", tz="Wien")


# Windows


def test_a_window_is_known_from_its_start_until_before_its_end(tmp_path):
    """UNKNOWN at the end, the last row's state again at the next start."""
    rows = "2026-03-01T10:00,a,OPEN\n"
    windows = "a,2026-03-01T09:00,2026-03-01T12:00\na,2026-03-01T14:00,2026-03-01T15:00\n"

    assert [
        ("2026-03-01T10:00:00+01:00", "OPEN"),
        ("2026-03-01T12:00:00+01:00", "UNKNOWN"),
        ("2026-03-01T14:00:00+01:00", "OPEN"),
        ("2026-03-01T15:00:00+01:00", "UNKNOWN"),
    ] == [(at, state) for at, _, state, _ in read(tmp_path, rows, windows)]


@pytest.mark.parametrize(
    ("rows", "windows", "expected"),
    [
        # A row at the very start says itself what is known.
        ("10 OPEN; 14 CLOSED", "9-12 14-15", "10 OPEN; 12 UNKNOWN; 14 CLOSED; 15 UNKNOWN"),
        # A row at the very end comes first, then UNKNOWN.
        ("10 OPEN; 12 CLOSED", "9-12", "10 OPEN; 12 CLOSED; 12 UNKNOWN"),
        ("10 OPEN; 12 CLOSED", "9-12 14-15",
         "10 OPEN; 12 CLOSED; 12 UNKNOWN; 14 CLOSED; 15 UNKNOWN"),
        # UNKNOWN follows every row of that stamp.
        ("12 CLOSED; 12 OPEN", "9-12", "12 CLOSED; 12 OPEN; 12 UNKNOWN"),
        # Windows that touch are one.
        ("10 OPEN", "9-12 12-15", "10 OPEN; 15 UNKNOWN"),
        ("10 OPEN; 12 CLOSED", "9-12 12-15", "10 OPEN; 12 CLOSED; 15 UNKNOWN"),
        # Before the first row there is nothing to return.
        ("14 OPEN", "9-12 13-15", "14 OPEN; 15 UNKNOWN"),
        # What is UNKNOWN already is not said again.
        ("10 UNKNOWN", "9-12 13-15", "10 UNKNOWN"),
        # An empty window holds the rows of its one instant.
        ("10 OPEN", "10-10", "10 OPEN; 10 UNKNOWN"),
        ("10 OPEN", "9-12 13-13", "10 OPEN; 12 UNKNOWN"),
        # A row in no window is kept, and UNKNOWN follows it.
        ("10 OPEN; 13 CLOSED; 13 OPEN; 14 CLOSED", "9-12",
         "10 OPEN; 12 UNKNOWN; 13 CLOSED; 13 OPEN; 13 UNKNOWN; 14 CLOSED; 14 UNKNOWN"),
        ("13 CLOSED", "9-12 14-15", "13 CLOSED; 13 UNKNOWN; 14 CLOSED; 15 UNKNOWN"),
        # Windows in any order of lines.
        ("10 OPEN", "14-15 9-12", "10 OPEN; 12 UNKNOWN; 14 OPEN; 15 UNKNOWN"),
    ],
)  # fmt: skip
def test_rows_and_windows_at_the_same_instants(tmp_path, rows, windows, expected):
    """Hours of one day; each case says above it what it shows."""
    row_text = "".join(
        f"2026-03-01T{hour}:00,a,{state}\n" for hour, state in map(str.split, rows.split("; "))
    )
    window_text = "".join(
        f"a,2026-03-01T{int(start):02}:00,2026-03-01T{int(end):02}:00\n"
        for start, end in (window.split("-") for window in windows.split())
    )

    found = read(tmp_path, row_text, window_text)

    assert expected == "; ".join(f"{int(at[11:13])} {state}" for at, _, state, _ in found)


def test_what_windows_add_is_an_update(tmp_path):
    """A sighting is evidence, the end of knowledge is not."""
    path = written(tmp_path, "timestamp,door,state,accuracy\n2026-03-01T10:00,a,OPEN,0.9\n")
    windows = written(tmp_path, "door,start,end\na,2026-03-01,2026-03-02\n", "w.csv")

    found = read_door_csv(path, windows=windows, tz="UTC")

    assert [0.9] == found.accuracy[:1].tolist()
    assert np.isnan(found.accuracy[1:]).all()
    assert (1, 2) == (found.rows_in_file, len(found))


def test_rows_and_doors_without_windows_are_said(tmp_path):
    """A warning, for it may be a slip; a door without any window is known at all times."""
    path = written(tmp_path, "timestamp,door,state\n2026-03-05,a,OPEN\n2026-03-05,b,OPEN\n")
    windows = written(tmp_path, "door,start,end\na,2026-03-01,2026-03-02\n", "w.csv")

    assert (
        "door 'a': rows in none of its windows: 1; UNKNOWN follows each",
        "door 'b': no window; taken as known at all times",
    ) == read_door_csv(path, windows=windows, tz="UTC").warnings


@pytest.mark.parametrize(
    ("windows", "message"),
    [
        (
            "a,2026-03-02,2026-03-01",
            "w.csv:2: door 'a': expected a window that ends after it start",
        ),
        ("a,2026-03-01,2026-03-03\na,2026-03-02,2026-03-04", "w.csv:3: .* does that of line 2"),
        ("b,2026-03-01,2026-03-03", "w.csv:2: expected a door that has rows in the CSV file, got"),
        ("a,2026-03-01,soon", "w.csv:2: Expected a time"),
        ("a,2026-03-01", "w.csv:2: expected 3 cells"),
    ],
)
def test_what_is_wrong_with_windows_is_told_with_its_line(tmp_path, windows, message):
    """The lines are those of the windows file."""
    with pytest.raises(FormatError, match=message):
        read(tmp_path, "2026-03-01,a,OPEN", windows)


# Changes of clocks


def test_in_the_hour_that_comes_twice_the_order_of_the_file_decides(tmp_path):
    """02:10 after 02:50 is the second 02:10, of whichever door."""
    rows = "".join(f"2025-10-26T02:{minute},a,OPEN\n" for minute in ("10", "50", "10", "50"))
    rows += "2025-10-26T02:50,b,OPEN\n2025-10-26T03:00,a,OPEN\n"
    path = written(tmp_path, f"timestamp,door,state\n{rows}")

    assert [
        "2025-10-26T02:10:00+02:00",
        "2025-10-26T02:50:00+02:00",
        "2025-10-26T02:10:00+01:00",
        "2025-10-26T02:50:00+01:00",
        "2025-10-26T02:50:00+01:00",
        "2025-10-26T03:00:00+01:00",
    ] == [row[0] for row in read(tmp_path, rows)]
    (warning,) = read_door_csv(path, tz=VIENNA).warnings
    assert "twice in Europe/Vienna: 5" in warning


def test_where_the_file_runs_backwards_each_doors_own_order_decides(tmp_path):
    """Rows of one door after the other: what comes after another door's last says nothing."""
    a = "2025-10-26T02:10,a,OPEN\n2025-10-26T02:05,a,CLOSED\n2025-12-01T12:00,a,OPEN\n"
    b = "2025-10-01T02:00,b,OPEN\n2025-10-26T02:30,b,CLOSED\n2025-10-26T02:20,b,OPEN\n"

    assert [
        *("02:10:00+02:00", "02:05:00+01:00", "12:00:00+01:00"),
        *("02:00:00+02:00", "02:30:00+02:00", "02:20:00+01:00"),
    ] == [row[0][11:] for row in read(tmp_path, a + b)]


@pytest.mark.parametrize("is_plain", [True, False])
def test_blanks_around_cells_do_not_count(tmp_path, monkeypatch, is_plain):
    """Of no column, quoted or not; those within a name do."""
    if is_plain:
        monkeypatch.setattr(CsvBlocks, "rows", lambda *_: pytest.fail("row by row"))
    quote = "" if is_plain else '"'
    text = (
        f"timestamp , door, state,accuracy\n 2026-03-01 , {quote}main  gate {quote}, open\t, 0.9 \n"
    )

    ((_, door, state, accuracy),) = read_door_csv(written(tmp_path, text), tz="UTC")

    assert ("main  gate", DoorState.OPEN, 0.9) == (door, state, accuracy)


@pytest.mark.parametrize("time", ["@1772434800", "@1772434800.000", "@1772434800000000000"])
def test_seconds_since_1970_are_times(tmp_path, time):
    """As the message about other times says."""
    assert ["2026-03-02T08:00:00+01:00"] == [row[0] for row in read(tmp_path, f"{time},a,OPEN\n")]


def test_a_third_time_through_that_hour_runs_backwards(tmp_path):
    """It comes twice only."""
    rows = "".join(f"2025-10-26T02:{minute},a,OPEN\n" for minute in ("50", "40", "30"))

    with pytest.raises(FormatError, match=r"doors.csv:4"):
        read(tmp_path, rows)


def test_a_window_may_end_in_the_second_coming_of_its_hour(tmp_path):
    """From 02:50 to 02:10 is twenty minutes then."""
    rows = "2025-10-26T02:50,a,OPEN"

    found = read(tmp_path, rows, "a,2025-10-26T02:50,2025-10-26T02:10")

    assert ("2025-10-26T02:10:00+01:00", "a", "UNKNOWN", None) == found[-1]


def test_a_column_of_times_reads_as_its_texts_one_by_one(tmp_path):
    """The fast way over days with and without changes of clocks, in zones with odd ones."""
    chance = random.Random(1)
    for tz in ("Europe/Vienna", "Australia/Lord_Howe", "America/St_Johns", "Asia/Kathmandu"):
        stamps = sorted(chance.randrange(10**18, 18 * 10**17) // 1000 * 1000 for _ in range(2000))
        rows = [Sighting(ns, "a", DoorState.OPEN, NAN) for ns in stamps]
        path = written(tmp_path, "".join(dump_door_csv(rows, tz=tz)))

        assert stamps == read_door_csv(path, tz=tz).happened_ns.tolist()


# Out


def test_what_is_written_reads_as_the_same_rows(tmp_path):
    """Nanoseconds and all; an accuracy where there is one."""
    rows = [
        Sighting(parse_instant("2025-10-26T02:30+01:00", tz=VIENNA), "a", DoorState.MOVING, 1.0),
        Sighting(parse_instant("2026-03-01T12:00:00.000000001", tz=VIENNA), "a",
                 DoorState.OFFLINE, 0.987654321),
    ]  # fmt: skip

    text = "".join(dump_door_csv(rows, tz=VIENNA))

    assert (
        "timestamp,door,state,accuracy\n"
        "2025-10-26T02:30:00+01:00,a,MOVING,1.0\n"
        "2026-03-01T12:00:00.000000001+01:00,a,OFFLINE,0.987654321\n"
    ) == text
    assert rows == list(read_door_csv(written(tmp_path, text), tz=VIENNA))


ONE = DoorId(1)


@pytest.mark.parametrize(
    ("event", "expected"),
    [
        (DoorAdded(door_id=ONE, state=DoorState.CLOSED), "CLOSED nan"),
        (DoorUpdated(door_id=ONE, changed=Changed.STATE, state=DoorState.OPEN), "OPEN nan"),
        (DoorUpdated(door_id=ONE, changed=Changed.WIDTH, width=1.0), None),
        (DoorObserved(door_id=ONE, state=DoorState.OPEN, accuracy_open=0.8), "OPEN 0.8"),
        (DoorObserved(door_id=ONE, state=DoorState.CLOSED, accuracy_open=0.8), "CLOSED 1.0"),
        (DoorPassed(door_id=ONE, passed=True), "OPEN 1.0"),
        (DoorPassed(door_id=ONE, passed=False), None),
        (DoorRequested(door_id=ONE, state=DoorState.OPEN), None),
        (DoorRemoved(door_id=ONE), None),
    ],
)
def test_which_events_are_rows(event, expected):
    """Those that set the state."""
    row = sighting_of(event, happened_ns=5, door="a")

    assert expected == (row and f"{row.state.name} {row.accuracy}")


# The real sets
