"""The page and its pictures: all in one file, the same each time, with what the runs say."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from navigation.page.drawing import INK, LINE
from navigation.page.histograms import BINS, histogram, normal_curve
from navigation.page.page import page_of
from navigation.page.run_lanes import door_lanes
from navigation.reading_verbs import read_runs
from navigation.records import START_NS, RunKey
from navigation.runs import read_run
from navigation.tables.words import words_of
from navigation.tests.corridor import drive
from navigation.tests.test_experiment_tables import run
from tests.browser import a_page


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return runs with a sweep in them."""
    out = tmp_path_factory.mktemp("runs")
    for seed in (1, 2):
        for setup in ("no_map", "map", "map_star"):
            drive(out, setup, seed, goals=25, near_m=3.0)
        drive(out, "map", seed, goals=12, near_m=1.0, building="corridor,near_m=1.0")
    return out


REFERS = {"href", "src", "xlink:href"}


class Page(HTMLParser):
    """What a page is made of."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.refers: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in {"meta", "use"}:
            self.open.append(tag)
        self.refers += [
            value or "" for name, value in attrs if name in {"href", "src", "xlink:href"}
        ]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in {"meta", "use"}:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag not in {"meta", "use"}:
            assert self.open.pop() == tag


def test_the_page_is_whole_and_asks_for_nothing(runs: Path) -> None:
    """
    Every element closed; whatever it refers to, is in it.
    """
    text = page_of(read_runs([runs]))
    page = Page(text)

    assert not page.open
    assert all(refers.startswith(("#", "data:image/png;base64,")) for refers in page.refers)
    assert "script" not in page.tags
    assert page.tags.count("svg") == 1 + 3 + 1 + 1  # bars, histograms, a sweep, a plan
    assert not {INK, LINE} & set(re.findall(r"#[0-9a-f]{6}", text))
    assert "currentColor" in text


def test_the_page_says_what_the_runs_say(runs: Path) -> None:
    """
    Words and tables, of one building: a swept option makes no other.
    """
    grouped = read_runs([runs])
    text = page_of(grouped).replace("&#x27;", "'")

    assert ["corridor"] == grouped.buildings
    for words in words_of(grouped, "corridor"):
        assert words in text
    for title in ("RUNTIMES, corridor", "NUMBER OF GOALS", "PAIRED DIFFERENCES", "SWEEP OF near_m"):
        assert title in text
    assert "thesis, 1 run" in text


def test_setups_that_the_thesis_lacks_are_explained_where_they_are(tmp_path: Path) -> None:
    drive(tmp_path, "patrol", 1, goals=12)
    drive(tmp_path, "map_star", 1, goals=12)
    page = page_of(read_runs([tmp_path]))

    assert "Patrol: as Belief, and of ten goals it picks" in page
    assert "Smart:" not in page


def test_names_of_buildings_are_words(tmp_path: Path) -> None:
    """
    And no part of the page.
    """
    for seed in (1, 2):
        drive(tmp_path, "map", seed, goals=12, building="<b>&corridor")

    text = page_of(read_runs([tmp_path]))

    assert "<b>" not in text
    assert "&lt;b&gt;&amp;corridor" in text


def test_the_verb_writes_the_same_page_twice(runs: Path, tmp_path: Path) -> None:
    """
    And the histograms beside it, a picture a setup.
    """
    pages = [tmp_path / name for name in ("one.html", "two.html")]
    for path in pages:
        words = ["--to", str(path), "--pictures", str(tmp_path / "pictures"), "--jobs", "1"]
        assert run("page", str(runs), *words) == 0

    assert pages[0].read_bytes() == pages[1].read_bytes()
    pictures = sorted(path.name for path in (tmp_path / "pictures").iterdir())
    assert [
        f"times_corridor_fixed_{setup}.png" for setup in ("map", "map_star", "no_map")
    ] == pictures
    assert all((tmp_path / "pictures" / name).read_bytes()[1:4] == b"PNG" for name in pictures)


@pytest.mark.slow
@pytest.mark.parametrize("size", [(390, 800), (1280, 900)], ids=["phone", "desk"])
def test_a_browser_shows_it_without_complaint(
    runs: Path, tmp_path: Path, size: tuple[int, int]
) -> None:
    """
    Nothing is wider than the screen: tables scroll in their own place.
    """
    path = tmp_path / "experiment.html"
    run("page", str(runs), "--to", str(path), "--jobs", "1")

    with a_page(size=size) as page:
        page.open(path.as_uri())
        wide = page.evaluate("document.documentElement.scrollWidth")

        assert page.complaints == []
        assert wide <= size[0]


def test_a_histogram_has_fifty_bins_and_its_normal_curve(runs: Path) -> None:
    """
    The bins hold all goals; the dashed red curve has their mean, deviation and number.
    """
    found = read_runs([runs]).of("corridor", "fixed", "map")
    took_s = np.array([seconds for each in found for seconds in each.took_s])

    (ax,) = histogram("map", found).axes

    assert len(ax.patches) == BINS == 50
    assert sum(bar.get_height() for bar in ax.patches) == len(took_s)
    (line,) = ax.lines
    assert line.get_linestyle() == "--"
    at, heights = line.get_data()
    width = np.ptp(took_s) / BINS
    assert at[heights.argmax()] == pytest.approx(took_s.mean(), abs=width)
    assert heights.max() == pytest.approx(
        len(took_s) * width / took_s.std() / np.sqrt(2 * np.pi), rel=1e-3
    )


def test_the_normal_curve_holds_as_many_goals() -> None:
    """
    Summed over bins far to both sides; of equal values there is none.
    """
    values = np.random.default_rng(1).normal(100, 20, 400)
    edges = np.linspace(0, 200, 51)

    at, heights = normal_curve(values, edges)

    assert np.trapezoid(heights, at) / (edges[1] - edges[0]) == pytest.approx(400, rel=1e-3)
    assert not len(normal_curve(np.array([5.0, 5.0]), edges)[0])


def test_no_goal_reached_is_no_histogram() -> None:
    """
    Nor an error.
    """
    assert histogram("map", []) is None


def test_lanes_say_how_the_map_was_wrong(tmp_path: Path) -> None:
    """
    At each goal, the doors that the drive itself had down as wrong.
    """
    tally = drive(tmp_path, goals=40)
    lanes = door_lanes(read_run(RunKey("corridor", "map", "fixed", 1).folder(tmp_path)))

    def wrong_at(at_ns: int) -> set[int]:
        said = {d: [w for ns, w in each.wrong() if ns <= at_ns][-1] for d, each in lanes.items()}
        return {door for door, words in said.items() if words}

    assert tally.wrong == [
        (at_s, wrong_at(START_NS + round(at_s * 1e9))) for at_s, _ in tally.wrong
    ]
    words = {words for each in lanes.values() for _, words in each.wrong()}
    assert words == {"", "OPEN, not CLOSED", "CLOSED, not OPEN"}
    assert {"door_1", "door_2", "door_3"} == {each.name for each in lanes.values()}
