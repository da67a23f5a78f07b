"""Lines of files that strangers packed: numbered, blank ones passed over, and never too many."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.csv_blocks import read_rows
from semmap_log.interop.formats.parsing import foreign_file
from semmap_log.interop.formats.parsing.foreign_file import (
    FREE_BYTES,
    MOST_RATIO,
    numbered_lines,
    open_unpacked,
)
from semmap_log.interop.formats.parsing.problems import Problems
from semmap_log.interop.importing.importing_lines import plan_event_lines
from tests.interop.importing.nothing_stored import NothingStored, lines_of
from tests.interop.importing.test_importing_lines import PRESENT

Pack = Callable[[bytes], bytes]
PACKS = [bytes, gzip.compress]


@pytest.mark.parametrize("pack", PACKS)
@given(
    text=st.text("a\n\r \t\f", max_size=60),
    block=st.sampled_from([1, 2, 7, 2**20]),
)
def test_every_line_that_is_not_blank_has_its_number(
    pack: Pack, text: str, block: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """However little is read at once, with and without a last line feed."""
    path = tmp_path_factory.getbasetemp() / "lines"
    path.write_bytes(pack(text.encode()))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(foreign_file, "BLOCK_BYTES", block)
        found = list(numbered_lines(path, most_bytes=99))

    lines = enumerate(text.split("\n"), start=1)
    assert [(number, line) for number, line in lines if line.strip()] == found


@pytest.mark.parametrize("pack", PACKS)
def test_a_line_may_be_so_long(pack: Pack, tmp_path: Path) -> None:
    """One byte more is an error that names it, whether it has an end or not."""
    path = tmp_path / "lines"
    path.write_bytes(pack(b"\n\n" + b"x" * 99 + b"\n"))
    assert [(3, "x" * 99)] == list(numbered_lines(path, most_bytes=99))

    for end in (b"\n", b""):
        path.write_bytes(pack(b"\n\n" + b"x" * 100 + end))
        with pytest.raises(FormatError, match="99 bytes"):
            list(numbered_lines(path, most_bytes=99))


def test_a_gzip_file_that_holds_too_much_is_refused_before_a_line_is_read(tmp_path: Path) -> None:
    """Lines that are all alike are packed a thousandfold."""
    path = tmp_path / "alike.jsonl.gz"
    good = b'{"kind": "DoorObserved", "door": "front", "state": "OPEN"}\n'
    for parts in ([good * (FREE_BYTES // len(good) + 1)], [good, b"\n" * (FREE_BYTES + 1)]):
        path.write_bytes(b"".join(map(gzip.compress, parts)))

        with pytest.raises(FormatError, match="16 MiB, or 250 times"):
            next(numbered_lines(path, most_bytes=99))
        with pytest.raises(FormatError, match="unpack it yourself: gzip -d"):
            next(read_rows(path, Problems(path), required=("door",)))


def test_a_gzip_file_may_hold_so_much(tmp_path: Path) -> None:
    """16 MiB, and more where it has enough bytes; it is closed with the one in it."""
    path = tmp_path / "alike.jsonl.gz"
    path.write_bytes(gzip.compress(b" " * FREE_BYTES))
    assert [] == list(numbered_lines(path, most_bytes=FREE_BYTES))

    noise = bytes(range(256)) * (FREE_BYTES // 256)
    path.write_bytes(gzip.compress(noise + b"x" * FREE_BYTES, 1))
    assert 2 * FREE_BYTES < MOST_RATIO * path.stat().st_size
    with open_unpacked(path) as file:
        raw = file.fileobj  # type: ignore[attr-defined]
        assert noise == file.read(len(noise))
    assert raw.closed


def test_a_file_of_very_many_bad_lines_is_not_read_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of lines, and of rows: what was found is told."""
    most = 500
    monkeypatch.setattr("semmap_log.interop.formats.parsing.problems.MOST_PROBLEMS", most)
    path = tmp_path / "in.jsonl"
    path.write_bytes(b"0\n" * (most + 10))
    with pytest.raises(FormatError, match=f"the last on line {most}$"):
        plan_event_lines(path, PRESENT, lines_of("UTC"), NothingStored(), now_ns=0)

    path.write_bytes(b"door,start,end\n" + b"0\n" * (most + 10))
    problems = Problems(path)
    list(read_rows(path, problems, required=("door", "start", "end")))
    with pytest.raises(FormatError, match=f"the last on line {most + 1}$"):
        problems.raise_any()


@given(text=st.text('a,\n\r"', max_size=40), block=st.sampled_from([1, 7, 2**20]))
def test_rows_have_the_number_of_their_last_line(
    text: str, block: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """With blank lines between them, and line breaks in quotes; else it is not CSV."""
    import csv

    path = tmp_path_factory.getbasetemp() / "rows.csv"
    path.write_bytes(f"door\n{text}".encode())
    reader = csv.reader([f"{line}\n" for line in f"door\n{text}".split("\n")], strict=True)
    try:
        expected = [
            (reader.line_num, [cell.strip() for cell in cells]) for cells in reader if cells
        ]
    except csv.Error:
        expected = []

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("semmap_log.interop.formats.files.csv_blocks.BLOCK_BYTES", block)
        problems = Problems(path)
        try:
            rows = [row for some in read_rows(path, problems, required=("door",)) for row in some]
        except FormatError as error:
            assert not expected or "not CSV" in str(error)
            return

    assert [(n, cells) for n, cells in expected[1:] if len(cells) == 1] == [tuple(r) for r in rows]
