"""What a notebook shows: tables as HTML, figures, and one short line in all other places."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs import probabilities
from semmap_log.core.folds.timeline import Timeline
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved
from semmap_log.errors import MissingExtraError
from semmap_log.store.reading.reader import LogReader
from semmap_log.views import column_table
from tests.conftest import SteadyClock

EVIL = "<script>alert('x')</script> & \"co\""


class _Table(HTMLParser):
    """Reads the cells of tables, row by row; all else as text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.tags: set[str] = set()
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        assert {name for name, _ in attrs} <= {"style"}
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


@pytest.fixture
def log(tmp_path: Path) -> Iterator[sl.DoorLogWriter]:
    """A log whose every text is one that a page must not believe."""
    with sl.create(tmp_path / "log", tz="UTC", building=EVIL, clock=SteadyClock()) as log:
        door = log.add_door(x=0, y=0, theta=0, width=1, name=EVIL)
        log.observe(door, "open", actor=EVIL, reason=EVIL)
        yield log


def shown_values(log: sl.DoorLogWriter) -> dict[str, Any]:
    """Return one of everything that shows itself."""
    seen = DoorObserved(door_id=DoorId(1), state=DoorState.CLOSED)
    appended = log.append([seen], note=sl.Note(actor=EVIL, source=EVIL, reason=EVIL))
    return {
        "DoorLogWriter": log,
        "DoorLog": sl.read(log.path),
        "DoorMap": log.replay(),
        "Timeline": log.timeline(1),
        "Diff": log.diff("event:0", f"event:{log.last_event()}"),
        "HistoryEntry": log.entry(log.last_event()),
        "Appended": appended,
        "DoorBeliefs": probabilities(log),
        "DoorBelief": probabilities(log)[0],
    }


def test_everything_is_a_table_in_which_texts_are_texts(log: sl.DoorLogWriter) -> None:
    """No tag but those of tables, whatever doors, people and buildings are called."""
    for name, value in shown_values(log).items():
        assert name == type(value).__name__
        table = _Table(value._repr_html_())

        assert table.tags <= {"div", "table", "thead", "tbody", "tr", "th", "td", "p"}
        assert table.rows
        texts = [cell for row in table.rows for cell in row]
        if name != "Timeline":
            assert any(EVIL in cell for cell in texts), name


def test_other_places_have_one_short_line(log: sl.DoorLogWriter) -> None:
    """Which says what it is and how much, whatever it holds."""
    values = shown_values(log)
    said = f"{str(log.path)!r}: 4 events, 2026-03-01 21:20:00 to 2026-03-01 21:20:00"

    assert {
        "DoorLogWriter": f"<DoorLogWriter {said}>",
        "DoorLog": f"<DoorLog {said}>",
        "DoorMap": "<DoorMap of 1 door, up to event 3>",
        "Timeline": "<Timeline of door 1: 3 intervals>",
        "Diff": "<Diff of doors: 0 added, 0 removed, 1 changed; 3 events>",
        "Appended": "<Appended events 3 to 3>",
    } == {name: repr(values[name]) for name in (
        "DoorLogWriter", "DoorLog", "DoorMap", "Timeline", "Diff", "Appended",
    )}  # fmt: skip
    assert repr(values["DoorBelief"]).startswith(f"<DoorBelief of {EVIL!r}: P(open) 0.0")


def test_the_rows_of_a_door_map_are_its_doors(log: sl.DoorLogWriter) -> None:
    """The table that `replay` prints."""
    log.add_door(name="back")

    head, *rows = _Table(log.replay()._repr_html_()).rows

    assert ["id", "name"] == head[:2]
    assert [["1", EVIL], ["2", "back"]] == [row[:2] for row in rows]
    assert ["OPEN", "UNKNOWN"] == [row[head.index("state")] for row in rows]


def test_long_tables_are_cut_and_say_so(
    log: sl.DoorLogWriter, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(column_table, "MOST_ROWS", 3)
    for _ in range(6):
        log.add_door()

    html = log.replay()._repr_html_()

    assert 1 + 3 == len(_Table(html).rows)
    assert "… and 4 rows more" in html


def test_a_timeline_of_nothing_says_so() -> None:
    assert "door 7: never there" in Timeline.empty(DoorId(7))._repr_html_()


@pytest.mark.parametrize("show", [repr, lambda log: log._repr_html_()])
def test_showing_a_log_reads_no_log(
    log: sl.DoorLogWriter, monkeypatch: pytest.MonkeyPatch, show: Any
) -> None:
    """A notebook shows whatever stands in the last line of a cell."""

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("read")

    log.close()
    opened = sl.read(log.path)
    for name in ("pages", "batches", "commits"):
        monkeypatch.setattr(LogReader, name, refused)

    assert "3" in show(opened)


def test_a_damaged_log_can_be_looked_at(log: sl.DoorLogWriter) -> None:
    """A repr that raises would hide from a debugger what is wrong."""
    log.close()
    opened = sl.read(log.path)
    (segment,) = log.path.glob("*.mcap")
    segment.write_bytes(bytes(segment.stat().st_size))

    assert repr(opened).startswith(f"<DoorLog {str(log.path)!r}: ")


def test_figures_show_themselves(log: sl.DoorLogWriter) -> None:
    """The lanes of a log, of some of its doors, and of one timeline, as pictures."""
    log.add_door(name="back")

    figures = [log.plot(), log.plot(doors=["back"]), log.timeline("back").plot(name="back")]

    lanes = [figure.axes[0].get_yticklabels() for figure in figures]
    assert [2, 1, 1] == list(map(len, lanes))
    assert {"back"} == {labels[-1].get_text() for labels in lanes}
    for figure in figures:
        assert b"\x89PNG" == figure._repr_png_()[:4]


def test_without_matplotlib_a_plot_says_what_to_install(
    log: sl.DoorLogWriter, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for name in ("figures", "lanes"):
        monkeypatch.delitem(sys.modules, f"semmap_log.views.plots.{name}", raising=False)
        monkeypatch.delattr(f"semmap_log.views.plots.{name}", raising=False)

    for plot in (log.plot, log.timeline(1).plot):
        with pytest.raises(MissingExtraError, match=r"matplotlib.*'semmap-log\[plots\]'"):
            plot()


def test_a_log_names_its_events(log: sl.DoorLogWriter) -> None:
    count = log.last_event() + 1

    assert f": {count} events, " in repr(log)


def test_what_draws_is_loaded_when_somebody_looks(log: sl.DoorLogWriter) -> None:
    """A log that is asked needs no view; the line of a repr neither."""
    log.close()
    code = (
        "import sys, semmap_log as sl; log = sl.read(sys.argv[1]);"
        "repr(log), repr(log.replay());"
        "print([name for name in sys.modules if name.startswith(('semmap_log.views', 'rich'))])"
    )

    done = subprocess.run(
        [sys.executable, "-c", code, log.path], capture_output=True, text=True, check=True
    )

    assert "[]" == done.stdout.strip()


def test_why_shows_the_table_of_the_verb() -> None:
    """And says in one line what was true, and what was believed."""
    told = sl.read(Path(__file__).parents[2] / "recordings" / "office").why("main_door", "10:30")

    said = (
        "<Explanation of 'main_door' at 2026-03-02T09:30:00.000000000Z: true OPEN, believed CLOSED>"
    )
    assert said == repr(told)
    rows = _Table(told._repr_html_()).rows
    assert ["true", "OPEN since 06:55:00, for 2 hours 35 minutes"] in rows
    assert "believed" in [row[0] for row in rows]
