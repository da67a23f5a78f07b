"""`report` as a user types it."""

from __future__ import annotations

from pathlib import Path

import pytest

from semmap_log.views.palette import COLOUR_BLIND
from semmap_log.views.report.content import hex_of
from tests.verbs import Refuses, run
from tests.views.report.pages import data_of
from tests.views.rerun.some_logs import small_log


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the log `log`."""
    monkeypatch.chdir(tmp_path)
    small_log(tmp_path / "log")
    return tmp_path


def test_it_says_what_it_wrote(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On stderr; stdout stays empty."""
    code = run("report", "log", "page.html")

    said = capsys.readouterr()
    assert 0 == code
    assert "" == said.out
    assert said.err.startswith("page.html: 2 doors, 21 events, ")


def test_its_options_choose_what_is_shown(folder: Path) -> None:
    """Span, doors, zone and colours."""
    code = run("report", "log", "page.html", "--since", "2026-03-01T21:30Z", "--until",
               "2026-03-01T21:45Z", "--door", "front", "--tz", "Asia/Tokyo",
               "--palette", "colour-blind")  # fmt: skip

    html = (folder / "page.html").read_text(encoding="utf-8")
    data = data_of(html)
    assert 0 == code
    assert 1_772_400_600_000 == data["begin"]
    assert data["end"] < 900_000
    assert ["front"] == [door["name"] for door in data["doors"]]
    assert "Asia/Tokyo" == data["log"]["tz"]
    assert f"--open: {hex_of(COLOUR_BLIND.open)};" in html


def test_what_cannot_be_done_is_said(folder: Path, refuses: Refuses) -> None:
    """In a line, with what to do; and no page is written."""
    refuses("""
        report log log/page.html
        report log no/page.html
        report log page.txt
        report nothing page.html
        report log page.html --tz Mars
        report log page.html --tz ''
        report log page.html --door back
        report log page.html --since now --until '1h ago'
        report log page.html --palette grey
    """)

    assert ["log"] == [path.name for path in folder.iterdir()]


def test_help_has_examples(capsys: pytest.CaptureFixture[str]) -> None:
    """And fits 80 columns."""
    code = run("report", "--help")

    out = capsys.readouterr().out
    assert 0 == code
    assert "semmap-log report office office.html" in out
    assert max(map(len, out.splitlines())) <= 80
