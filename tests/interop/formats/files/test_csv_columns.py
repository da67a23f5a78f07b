"""The quick way through a CSV file gives what the careful one gives: values, errors, lines."""

from __future__ import annotations

import gzip
import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.model.moments import both_instants
from semmap_log.errors import FormatError, MomentError, OutputError
from semmap_log.interop.formats.files import csv_blocks
from semmap_log.interop.formats.files import csv_sightings as sightings
from semmap_log.interop.formats.files.csv_blocks import CsvBlocks
from semmap_log.interop.formats.files.csv_windows import instants_of
from semmap_log.interop.formats.files.door_csv import read_door_csv
from semmap_log.interop.formats.parsing.text_column import TextCodes, TextColumn, decimals_in

VIENNA = "Europe/Vienna"


def answer(path: Path, *, quick: bool, block_bytes: int) -> Any:
    """Return all that reading a file gives, or the error."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_blocks, "BLOCK_BYTES", block_bytes)
        if not quick:
            patch.setattr(CsvBlocks, "columns", lambda *_: None)
        try:
            found = read_door_csv(path, tz=VIENNA)
        except FormatError as error:
            return str(error)
    return found.doors, found.rows_in_file, list(map(repr, found)), found.warnings


times = st.sampled_from(
    ["2026-03-01T10:00:00", "2026-03-01 10:00:00.5", "2026-03-02", "2026-03-02T11:00Z",
     "2026-03-02T11:00:00,123456789+05:30", "2026-03-29T12:00:00", "2025-10-26T02:30:00",
     "2025-10-26T02:10:00", " 2026-03-02 ", "@1772373720", "2026-03-02T11:00:00-0130",
     "2026-03-02T11:00:00 +01"]
)  # fmt: skip
bad_times = st.sampled_from(["2026-02-30T00:00:00", "1969-01-01", "2026-03-29T02:30:00", "soon", "",
                             "2026-03-02T24:00:00", "2026-03-02T11:00:00+24:00", "9999-12-31",
                             "2026-03-02T11:60:00", "2026-13-02T11:00:00Z"])  # fmt: skip
names = st.sampled_from(["a", "b", "front door", "front dooR", "Küche", "x" * 70, "y" * 70, "-"])
states = st.sampled_from(["OPEN", "closed", " Moving ", "UNKNOWN", "OFFLINE"])
shares = st.sampled_from(
    ["", "0.9", "1", "0.5", ".75", "1.", "0.98765432109876543", "9e-1", " .6 "]
)
good = st.tuples(times, names, states, shares)
odd = st.tuples(
    times | bad_times,
    names | st.sampled_from(["", " ", "z" * 1001, '"q, ""r"""', '"two\nlines"', '"']),
    states | st.sampled_from(["AJAR", ""]),
    shares | st.sampled_from(["0.4", "nan", "1.0000001", "high", "1_0"]),
)
cells = good.map(",".join) | odd.map(",".join)
lines = st.lists(cells | st.sampled_from(["", "a,b", "a,b,c,d,e", " "]), max_size=12)
orderly = st.lists(good, max_size=30).map(lambda rows: [",".join(row) for row in sorted(rows)])


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    lines | orderly,
    st.sampled_from(["\n", "\r\n"]),
    st.booleans(),
    st.sampled_from([30, 100, 2**20]),
)
def test_columns_are_read_as_rows_are(
    tmp_path_factory: pytest.TempPathFactory, drawn, end, last_end, block_bytes
) -> None:
    """Odd times, quotes, blank and long lines, wrong ones of every sort, in blocks of any size."""
    path = tmp_path_factory.getbasetemp() / "some.csv"
    text = end.join(["timestamp,door,state,accuracy", *drawn]) + (end if last_end else "")
    path.write_bytes(text.encode())

    careful = answer(path, quick=False, block_bytes=block_bytes)

    assert careful == answer(path, quick=True, block_bytes=block_bytes)
    if "not CSV" not in careful:  # that ends the reading, and what else was found depends on where
        assert careful == answer(path, quick=True, block_bytes=2**20)


def test_plain_files_go_the_quick_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Carriage returns, blank lines, letters beyond ASCII, a missing last line end: all plain."""
    path = tmp_path / "doors.csv"
    text = "timestamp,state,door\r\n\r\n2026-03-01,OPEN,Küche\r\n2026-03-02T10:00Z,closed,a"
    path.write_bytes(gzip.compress(b"\xef\xbb\xbf" + text.encode()))
    monkeypatch.setattr(CsvBlocks, "rows", lambda *_: pytest.fail("row by row"))

    found = read_door_csv(path, tz="UTC")

    assert [("Küche", "OPEN"), ("a", "CLOSED")] == [(row.door, row.state.name) for row in found]


def _by_itself(text: str, tz: str) -> tuple[int, int] | str:
    try:
        return both_instants(text, tz=tz)
    except MomentError as error:
        return str(error)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(st.lists(times | bad_times | st.text(max_size=30), max_size=30),
       st.sampled_from([VIENNA, "UTC", "Australia/Lord_Howe"]))  # fmt: skip
def test_times_at_once_are_times_one_by_one(texts: list[str], tz: str) -> None:
    """Both instants of the hour that comes twice, and texts that are no times."""
    first, second, wrong = instants_of(texts, tz=tz)

    for i, text in enumerate(texts):
        found = wrong.get(i, (int(first[i]), int(second[i])))
        assert _by_itself(text, tz) == found


def test_many_days_out_of_order_are_read_too() -> None:
    """Each day is asked for its offset once, however the rows jump."""
    chance = random.Random(1)
    texts = [f"20{chance.randrange(20, 30)}-{chance.randrange(1, 13):02}-"
             f"{chance.randrange(1, 29):02}T12:00:00" for _ in range(3000)]  # fmt: skip

    first, _, wrong = instants_of(texts, tz=VIENNA)

    assert not wrong
    assert [both_instants(text, tz=VIENNA)[0] for text in texts] == first.tolist()


@settings(deadline=None)
@given(st.lists(st.floats(0, 1e6).map(repr) | st.decimals(0, 99, places=3).map(str)
                | st.text(".0123456789e-", max_size=20)))  # fmt: skip
def test_decimals_at_once_are_floats(texts: list[str]) -> None:
    """To the last bit; NaN for those that are left to `float`."""
    values = decimals_in(TextColumn.of(texts)).tolist()

    for text, value in zip(texts, values, strict=True):
        assert math.isnan(value) or value == float(text), text
        if text.replace(".", "", 1).isdigit():
            assert not math.isnan(value), text


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(st.lists(st.lists(st.text(max_size=40), max_size=40), max_size=4))
def test_texts_get_numbers_in_the_order_of_their_first_coming(columns: list[list[str]]) -> None:
    """The same text the same number, in later columns, too."""
    codes = TextCodes()
    for texts in columns:
        column = TextColumn.of(texts)
        given_codes = codes.codes_of(column, accepts=lambda _: True)

        if given_codes is None:
            assert any(len(text.encode()) > 64 for text in texts)
        else:
            assert texts == [codes.texts[code].decode() for code in given_codes.tolist()]
    assert len(codes.texts) == len(set(codes.texts))


def test_texts_whose_keys_collide_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """A key is only a hint: here all texts of a length have the same."""
    from semmap_log.interop.formats.parsing import text_column

    monkeypatch.setattr(text_column, "_MIX", np.uint64(0))
    codes = TextCodes()
    codes.codes_of(TextColumn.of(["aa"]), accepts=lambda _: True)

    assert codes.codes_of(TextColumn.of(["aa", "bb"]), accepts=lambda _: True) is None


def test_doors_by_the_thousand(tmp_path: Path) -> None:
    """More of them than there are slots to find them in."""
    path = tmp_path / "doors.csv"
    wanted = [f"door {i * 7919 % 10_007}" for i in range(20_000)]
    path.write_text("timestamp,door,state\n" + "".join(
        f"2026-03-01T00:00:00.{i:09},{name},OPEN\n" for i, name in enumerate(wanted)))  # fmt: skip

    found = read_door_csv(path, tz="UTC")

    assert wanted == [row.door for row in found]
    assert list(dict.fromkeys(wanted)) == list(found.doors)


def test_rows_wait_in_a_file_where_they_are_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same rows, as often as they are asked for."""
    path = tmp_path / "doors.csv"
    path.write_text("timestamp,door,state,accuracy\n" + "".join(
        f"2026-03-01T00:00:00.{i:03},a,OPEN,0.{5 + i % 5}\n" for i in range(999)))  # fmt: skip
    expected = list(read_door_csv(path, tz="UTC"))
    monkeypatch.setattr(sightings, "MOST_IN_MEMORY_BYTES", 100)
    monkeypatch.setattr(csv_blocks, "BLOCK_BYTES", 500)

    found = read_door_csv(path, tz="UTC")

    assert expected == list(found) == list(found)
    assert [row.accuracy for row in expected] == found.accuracy.tolist()


def test_no_room_for_them_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the folder, and what to do."""
    path = tmp_path / "doors.csv"
    path.write_text("timestamp,door,state\n2026-03-01,a,OPEN\n")
    full = Path("/dev/full")
    monkeypatch.setattr(
        sightings.tempfile, "SpooledTemporaryFile", lambda _: full.open("wb", buffering=0)
    )

    with pytest.raises(OutputError, match=r"no room .* \(No space left on device\); set TMPDIR"):
        read_door_csv(path, tz="UTC")


@pytest.mark.parametrize("state", ["OPEN", "AJAR"])
def test_rows_are_counted_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, state: str) -> None:
    """Also those that the quick way found, and left to the careful one."""
    path = tmp_path / "doors.csv"
    path.write_text("timestamp,door,state\n" + f"2026-03-01,a,{state}\n" * 9)
    monkeypatch.setattr(csv_blocks, "MOST_ROWS", 9)
    expected = "expected at most" if state == "OPEN" else "AJAR"

    if state == "OPEN":
        assert 9 == len(read_door_csv(path, tz="UTC"))
        path.write_text(path.read_text() + "2026-03-01,a,OPEN\n")
    with pytest.raises(FormatError, match=expected):
        read_door_csv(path, tz="UTC")
