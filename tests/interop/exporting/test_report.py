"""A page in a file: whole, or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import CommandError, FormatError, OutputError
from semmap_log.interop.exporting.html_report import write_report
from semmap_log.interop.exporting.log_files import export
from semmap_log.log.replay.replay import Scope
from semmap_log.views.report.content import report
from tests.views.report.pages import MS, data_of
from tests.views.rerun.some_logs import SECOND, START, small_log


@pytest.fixture
def log(tmp_path: Path) -> sl.DoorLog:
    return small_log(tmp_path / "log")


def test_the_file_is_the_page(log: sl.DoorLog, tmp_path: Path) -> None:
    """What is said of it is so; what was there before is gone."""
    out = tmp_path / "page.html"
    out.write_text("old")

    written = write_report(log, out)

    assert report(log).html == out.read_text(encoding="utf-8")
    assert (2, out.stat().st_size) == (written.doors, written.bytes)
    assert ["log", "page.html"] == sorted(path.name for path in tmp_path.iterdir())


def test_export_writes_the_same_page(log: sl.DoorLog, tmp_path: Path) -> None:
    """The name tells the format."""
    write_report(log, tmp_path / "a.html")

    export(log, tmp_path / "b.html")

    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_export_at_a_moment_ends_the_page_there(log: sl.DoorLog, tmp_path: Path) -> None:
    """The moment itself is on it."""
    at_ns = START + 1300 * SECOND

    export(log, tmp_path / "x.html", Scope(at_ns=at_ns))

    data = data_of((tmp_path / "x.html").read_text(encoding="utf-8"))
    assert data["begin"] + data["end"] <= at_ns // MS
    assert "given up after 12 s" == data["changes"][0]["what"]


@pytest.mark.parametrize("scope", [Scope(known_at_ns=START), Scope(event=3)])
def test_a_page_shows_what_is_known_today(log: sl.DoorLog, tmp_path: Path, scope: Scope) -> None:
    """What was believed then it does not show, and says so."""
    with pytest.raises(CommandError, match="--known-at and --event"):
        export(log, tmp_path / "x.html", scope)

    assert not (tmp_path / "x.html").exists()


def test_a_name_that_is_no_page_is_refused(log: sl.DoorLog, tmp_path: Path) -> None:
    """Nobody would find out how to open it."""
    with pytest.raises(FormatError, match=r"ends in \.html"):
        write_report(log, tmp_path / "page.pdf")


def test_a_folder_that_is_not_there_is_an_error(log: sl.DoorLog, tmp_path: Path) -> None:
    """It is not made."""
    with pytest.raises(OutputError, match="could not be written: No such file or directory"):
        write_report(log, tmp_path / "no" / "page.html")

    assert ["log"] == [path.name for path in tmp_path.iterdir()]
