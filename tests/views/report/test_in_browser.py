"""The page in a headless Chromium: what it shows, at which moment, and that it is left in peace."""

from __future__ import annotations

import io
import random
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded
from semmap_log.views.palette import COLOUR_BLIND, DEFAULT, Palette
from semmap_log.views.report.content import report
from tests.browser import Page, a_page, as_url
from tests.conftest import SteadyClock
from tests.views.report.pages import (
    data_of,
    log_of,
    replayed_at,
    retracted_log,
    telling_moments,
    watched_log,
)
from tests.views.rerun.some_logs import START, small_log

RECORDINGS = Path(__file__).parents[3] / "recordings"
HOSTILE = "</script><img src=x onerror=\"document.title='hacked'\">"
DESK, PHONE = (1440, 900), (390, 844)


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with a_page(size=DESK) as opened:
        yield opened


def shown(page: Page, folder: Path, log: sl.DoorLog, fragment: str = "", **how: Any) -> dict:
    """Open the page of a log, and return its data."""
    html = report(log, **how).html
    (folder / "page.html").write_text(html, encoding="utf-8")
    page.open("about:blank")
    page.open(as_url(folder / "page.html") + fragment)
    return data_of(html)


def go_to(page: Page, t: int) -> None:
    """Move the slider as a person does."""
    page.evaluate(
        f"(s => {{ s.value = {t}; s.dispatchEvent(new Event('input', {{bubbles: true}})) }})"
        "(document.getElementById('slider'))"
    )


SEEN_DOORS = """
    const doors = [...document.querySelectorAll('.level:not(.behind) .door:not(.gone)')].map(d => {
      const [x1, y1, x2, y2] = ['x1', 'y1', 'x2', 'y2']
        .map(name => +d.querySelector('.leaf').getAttribute(name));
      return {id: d.dataset.id, x: (x1 + x2) / 2, y: (y1 + y2) / 2, ends: [[x1, y1], [x2, y2]]};
    });
    const [, , width, height] = document.querySelector('.level:not(.behind) svg')
      .getAttribute('viewBox').split(' ').map(Number);
    const seen = doors.filter(d => d.x >= 0 && d.y >= 0 && d.x <= width && d.y <= height);
"""
DOORS_IN_SIGHT = f"(() => {{ {SEEN_DOORS} return seen.length }})()"
NEAREST_DOORS = f"""(() => {{ {SEEN_DOORS}
    return [...document.querySelectorAll('.level:not(.behind) .labels text')].map(label => {{
      const box = label.getBBox();
      const far = ([x, y]) => Math.hypot(Math.max(box.x - x, 0, x - box.x - box.width),
                                         Math.max(box.y - y, 0, y - box.y - box.height));
      const gap = d => Math.min(far([d.x, d.y]), ...d.ends.map(far));
      const nearest = doors.reduce((best, d) => (gap(d) < gap(best) ? d : best));
      return [label.textContent, nearest.id];
    }});
}})()"""
"""What each label says, and the id of the door that it is nearest to."""


def rows(page: Page) -> dict[int, str]:
    """The table's states, of the doors in the map."""
    said = page.evaluate(
        "[...document.querySelectorAll('#table tbody tr')]"
        ".map(row => [row.dataset.id, row.dataset.state])"
    )
    return {int(door): state for door, state in said if state}


def on_plans(page: Page) -> dict[int, str]:
    """The states of all doors that are drawn, or named below a plan."""
    said = page.evaluate(
        "[...document.querySelectorAll('.door:not(.gone), .chip')]"
        ".map(d => [d.dataset.id, d.dataset.state])"
    )
    return {int(door): state for door, state in said}


def ids_shown(page: Page) -> list[int]:
    found = page.evaluate(
        "[...document.querySelectorAll('#table tbody tr:not([hidden])')].map(r => +r.dataset.id)"
    )
    return list(found)


def picture_of(page: Page) -> Image.Image:
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


@pytest.mark.parametrize("seed", [1, 2])
def test_the_slider_moves_the_doors_as_a_replay_does(page: Page, tmp_path: Path, seed: int) -> None:
    """In the table and on the plans, at any moment."""
    log = retracted_log(tmp_path / "log", seed=seed)
    data = shown(page, tmp_path, log)

    for t in telling_moments(data, random.Random(seed), 12):
        go_to(page, t)

        true = {door: now["state"] for door, now in replayed_at(log, data, t).items()}
        assert true == rows(page), t
        assert true == on_plans(page), t
    assert [] == page.complaints


@pytest.mark.parametrize("palette", [DEFAULT, COLOUR_BLIND], ids=["default", "colour-blind"])
def test_a_door_has_its_states_colour_at_its_place(
    page: Page, tmp_path: Path, palette: Palette
) -> None:
    """The pixel in the middle of its line."""
    log = sl.read(RECORDINGS / "office")
    data = shown(page, tmp_path, log, palette=palette)

    for t in (data["end"] * 4 // 10, data["end"]):
        go_to(page, t)
        true = replayed_at(log, data, t)
        page.place(".map")
        picture = picture_of(page)
        for door, now in true.items():
            left, top, width, height = page.place(f".door[data-id='{door}'] .leaf")
            expected = palette.open if now["state"] == "OPEN" else palette.closed
            middle = round(left + width / 2), round(top + height / 2)
            assert _distance(picture, middle, expected) < 12, (t, door)
    assert {"OPEN", "CLOSED"} <= {now["state"] for now in replayed_at(
        log, data, data["end"] * 4 // 10).values()}  # fmt: skip


def _distance(picture: Image.Image, at: tuple[int, int], colour: tuple[int, int, int]) -> int:
    """How far the pixel that is most like a colour, of those around a point, is from it."""
    near = [picture.getpixel((at[0] + x, at[1] + y)) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    return min(max(abs(a - b) for a, b in zip(colour, one, strict=True)) for one in near)


def test_it_opens_at_the_last_change_and_a_link_opens_it_elsewhere(
    page: Page, tmp_path: Path
) -> None:
    """Not after a tail in which only the robot moved."""
    log = sl.read(RECORDINGS / "office")
    data = shown(page, tmp_path, log)
    opened_at = page.evaluate("+document.getElementById('slider').value")

    shown(page, tmp_path, log, "#t=2026-03-02T09:15:00.250+01:00&door=2")

    assert max(changes_of_state(data)) == opened_at < data["end"]
    chosen = page.evaluate("document.querySelector('tr.chosen').dataset.id")
    moment = page.evaluate("+document.getElementById('slider').value")
    assert "2" == chosen
    assert 1_772_439_300_250 - data["begin"] == moment
    assert "09:15:00" in page.evaluate("document.getElementById('clock').textContent")
    page.press("ArrowRight")
    page.wait_until("location.hash.includes('door=2') && !location.hash.includes('09:15')")


def test_arrow_keys_step_from_change_to_change(page: Page, tmp_path: Path) -> None:
    """Each stop is a change; with Shift, one of the chosen door."""
    log = small_log(tmp_path / "log")
    data = shown(page, tmp_path, log)
    moments = sorted({
        t for door in data["doors"] for t in (
            door["added"], *([door["removed"]] if door["removed"] else []),
            *(place[0] for place in door["places"]),
        )
    } | {round(t) for t in changes_of_state(data)})  # fmt: skip

    seen = []
    for _ in moments:
        seen.append(page.evaluate("+document.getElementById('slider').value"))
        page.press("ArrowLeft")

    assert moments == sorted(seen)
    page.press("ArrowRight")
    assert moments[0] == page.evaluate("+document.getElementById('slider').value")


def changes_of_state(data: dict) -> set[int]:
    """All moments at which a door's state became another."""
    found = set()
    for door in data["doors"]:
        t, before = 0, None
        for delta, state in zip(door["t"], door["s"], strict=True):
            t += delta
            if state != before:
                found.add(t)
            before = state
    return found


def test_playing_moves_on_and_stops_at_the_end(page: Page, tmp_path: Path) -> None:
    """With the space bar or the button; from the end it begins anew."""
    data = shown(page, tmp_path, small_log(tmp_path / "log"))
    page.evaluate("document.getElementById('speed').value = 1000")  # so it is seen on its way

    page.click("#play")
    page.wait_until("+document.getElementById('slider').value < "
                    f"{data['end']} && +document.getElementById('slider').value > 0")  # fmt: skip
    page.evaluate("document.getElementById('speed').value = 21600000")

    page.wait_until(f"+document.getElementById('slider').value === {data['end']}")
    assert "false" == page.evaluate("document.getElementById('play').ariaPressed")


def test_the_table_is_filtered_and_sorted(page: Page, tmp_path: Path) -> None:
    """By name, id, level and state; either way up."""
    shown(page, tmp_path, log_of(tmp_path / "log", "beta", "Alpha", "gamma 10", "gamma 9"))

    page.click("#table th.of-name button")
    by_name = ids_shown(page)
    page.click("#table th.of-name button")
    backwards = ids_shown(page)
    page.click("#filter")
    page.press(*"gam")
    filtered = ids_shown(page)

    assert [2, 1, 4, 3] == by_name
    assert [3, 4, 1, 2] == backwards
    assert [3, 4] == filtered
    assert "2 of 4 doors" == page.evaluate("document.getElementById('shown').textContent")
    page.evaluate(
        "(s => { s.value = '1'; s.dispatchEvent(new Event('change')) })"
        "(document.getElementById('filter-state'))"
    )
    assert [] == ids_shown(page)


def test_a_door_is_chosen_by_mouse_and_by_key(page: Page, tmp_path: Path) -> None:
    """Its lane, its row and its details follow; Escape lets it go."""
    shown(page, tmp_path, sl.read(RECORDINGS / "office"))

    page.click(".door[data-id='2']")
    by_mouse = page.evaluate("[...document.querySelectorAll('.chosen[data-id]')]"
                             ".map(e => e.tagName + e.dataset.id)")  # fmt: skip
    page.press("Escape")
    page.evaluate("document.querySelector(\".door[data-id='3']\").focus()")
    page.press("Enter")

    assert {"g2", "DIV2", "TR2"} <= set(by_mouse)
    assert {"2"} == {said[-1] for said in by_mouse}
    assert "hardware_door" in page.evaluate("document.querySelector('.details').textContent")


def test_hostile_names_are_inert(page: Page, tmp_path: Path) -> None:
    """They are shown as they are; nothing runs, nothing is asked for."""
    log = log_of(tmp_path / "log", HOSTILE, "javascript:alert(1)")

    shown(page, tmp_path, log)
    page.click(".door[data-id='1']")
    page.hover(".door[data-id='1']")

    assert "hacked" != page.evaluate("document.title")
    assert 0 == page.evaluate("document.querySelectorAll('img').length")
    assert HOSTILE == page.evaluate("document.querySelector('#table tbody bdi').textContent")
    assert HOSTILE in page.evaluate("document.getElementById('hint').textContent")
    assert [] == page.complaints


@pytest.mark.slow
def test_a_page_asks_for_nothing(tmp_path: Path) -> None:
    """But for itself; and its policy stops a script that is not its own."""
    with a_page(size=DESK) as page:
        shown(page, tmp_path, sl.read(RECORDINGS / "office"))
        page.evaluate(
            "document.body.append(Object.assign(document.createElement('script'),"
            " {textContent: 'window.foreign = 1'}))"
        )

        asked = {url.rsplit("/", 1)[-1] for url in page.requests}
        assert {"page.html"} == asked - {"about:blank"}
        assert page.evaluate("window.foreign === undefined")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "dark"), [(DESK, True), (PHONE, False)], ids=["desk by night", "phone by day"]
)
def test_it_fits_desks_and_phones_by_day_and_night(
    tmp_path: Path, size: tuple[int, int], dark: bool
) -> None:
    """Nothing is wider than the window, the plan is in it, and the themes differ."""
    with a_page(size=size, dark=dark) as page:
        shown(page, tmp_path, sl.read(RECORDINGS / "office"))
        picture = picture_of(page)

        assert size[0] == page.evaluate("document.documentElement.scrollWidth")
        left, _, width, height = page.place(".map")
        assert left >= 0
        assert left + width <= size[0]
        assert height > 150
        ground = picture.getpixel((2, 2))
        assert (max(ground) < 60) if dark else (min(ground) > 200)
        assert len(picture.getcolors(2**20) or []) > 50
        assert [] == page.complaints


@pytest.mark.slow
def test_it_prints_all_there_is(page: Page, tmp_path: Path) -> None:
    """Both levels, every lane and every row of a week of 133 doors; whatever was scrolled away."""
    data = shown(page, tmp_path, sl.read(RECORDINGS / "clinic_week"))
    (tmp_path / "page.pdf").write_bytes(page.pdf())

    try:
        words = subprocess.run(["pdftotext", "-layout", tmp_path / "page.pdf", "-"],
                               capture_output=True, text=True, check=True).stdout  # fmt: skip
    except FileNotFoundError:
        pytest.skip("pdftotext (poppler-utils) is not here: what was printed was not read")
    pages = words.split("\f")[:-1]
    assert all(len(text) > 200 for text in pages)
    there = {door["name"] for door in data["doors"] if door["removed"] is None}
    assert set() == {name for name in there if f"{name} " not in words}
    assert words.count("left_treatment_1") >= 3  # lane, row and week
    tables = [text for text in pages if "ago " in text and "Closed" in text]
    assert len(tables) >= 2
    assert all("Last seen" in text for text in tables)


@pytest.mark.parametrize(
    ("names", "placed"),
    [
        ((), True),
        (("only",), False),
        (("大门", "قاعة الاجتماعات", "🚪 x"), True),
        (("",) * 500, True),
    ],
    ids=["none", "one without a place", "scripts", "500"],
)
def test_odd_logs_make_pages_too(
    page: Page, tmp_path: Path, names: tuple[str, ...], placed: bool
) -> None:
    """No complaint, and as many rows as doors."""
    names = tuple(name or f"door no {i}" for i, name in enumerate(names))

    shown(page, tmp_path, log_of(tmp_path / "log", *names, placed=placed))

    said = page.evaluate(
        "[...document.querySelectorAll('#table .of-name bdi')].map(e => e.textContent)"
    )
    assert list(names) == said
    assert (not names) == (not page.evaluate("document.getElementById('empty').hidden"))
    assert [] == page.complaints


@pytest.mark.slow
@pytest.mark.parametrize("crowd", ["clinic", "row"])
def test_labels_do_not_cover_each_other(page: Page, tmp_path: Path, crowd: str) -> None:
    """On the plan of a clinic, and of doors with names longer than there is room; near and far."""
    row = [f"conference room {i}" for i in range(20)]
    log = sl.read(RECORDINGS / "clinic_week") if crowd == "clinic" else None
    shown(page, tmp_path, log or log_of(tmp_path / "log", *row))

    for _ in range(2):
        boxes = page.evaluate(
            "[...document.querySelectorAll('.level:not(.behind) .labels text')]"
            ".map(e => e.getBBox()).map(b => [b.x, b.y, b.x + b.width, b.y + b.height])"
        )
        assert len(boxes) >= 5
        assert [] == [
            (a, b) for i, a in enumerate(boxes) for b in boxes[:i]
            if min(a[2], b[2]) - max(a[0], b[0]) > 1 and min(a[3], b[3]) - max(a[1], b[1]) > 3
        ]  # fmt: skip
        page.click("#nearer")


def test_no_label_could_be_another_doors(page: Page, tmp_path: Path) -> None:
    """Of hundreds of doors side by side: each label is nearest to the door that it names."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([
            DoorAdded(door_id=DoorId(i + 1), x=i % 25 * 4.0, y=i // 25 * 4.0, theta=i % 4 * 1.571,
                      width=1.0)
            for i in range(300)
        ])  # fmt: skip
    shown(page, tmp_path, log)

    for _ in range(4):
        labels = page.evaluate(NEAREST_DOORS)
        (without,) = page.evaluate("[document.querySelector('.unlabelled').textContent]")

        assert len(labels) >= 5
        assert [] == [(text, door) for text, door in labels if text.split()[-1] != door]
        in_sight = page.evaluate(DOORS_IN_SIGHT)
        missing = in_sight - len(labels)
        assert missing == int("".join(c for c in without if c.isdecimal()) or 0)
        page.click("#nearer")


def test_rooms_are_tinted_and_named_until_somebody_hides_them(page: Page, tmp_path: Path) -> None:
    """Below the doors; a name shows where it has room, and no label of a door is near."""
    shown(page, tmp_path, sl.read(RECORDINGS / "office"))
    names = "[...document.querySelectorAll('.room-names text')].map((name) => name.textContent)"
    seen = "getComputedStyle(document.querySelector('{0}')).display !== 'none'"

    assert ["hall", "hardware room", "centre of excellence"] == page.evaluate(names)
    assert page.evaluate(seen.format(".rooms"))
    page.click("#with-rooms")
    assert not page.evaluate(seen.format(".rooms"))
    assert not page.evaluate(seen.format(".room-names"))
    assert "false" == page.evaluate("document.getElementById('with-rooms').ariaPressed")


@pytest.mark.slow
def test_a_lane_has_the_states_colours_over_time(page: Page, tmp_path: Path) -> None:
    """Every door, at fifty places along: the pixel at the lane's foot is what a replay says."""
    log = sl.read(RECORDINGS / "office")
    data = shown(page, tmp_path, log)
    page.place("#lanes")
    page.wait_until("document.querySelector('.lane[data-id] path')")
    picture = picture_of(page)

    for door in (1, 2, 3):
        left, top, width, height = page.place(f".lane[data-id='{door}'] svg")
        for share in range(1, 50):
            column = width * share / 50
            around = [round(data["end"] * (column + off) / width) for off in (-1, 0, 1, 2)]
            true = {replayed_at(log, data, t)[door]["state"] for t in around}
            if len(true) == 1:  # else a change is near, and one of both is right
                colour = {"OPEN": DEFAULT.open, "CLOSED": DEFAULT.closed,
                          "UNKNOWN": DEFAULT.unknown}[true.pop()]  # fmt: skip
                foot = round(left + column), round(top + height - 2)
                assert _distance(picture, foot, colour) < 12, (door, share)


@pytest.mark.slow
def test_lanes_of_hundreds_of_doors_come_in_pages(page: Page, tmp_path: Path) -> None:
    """So many at once, chosen by hand or with a door; on paper all of them."""
    log = log_of(tmp_path / "log", *[f"room {n}" for n in range(1, 251)])
    shown(page, tmp_path, log)
    first = lanes_shown(page)
    page.evaluate(
        "(s => { s.value = '1'; s.dispatchEvent(new Event('change')) })"
        "(document.getElementById('lane-page'))"
    )
    second = lanes_shown(page)

    shown(page, tmp_path, log, "#t=2026-03-01T21:20:00+01:00&door=250")

    assert [list(range(1, 151)), list(range(151, 251))] == [first, second]
    assert second == lanes_shown(page)
    (tmp_path / "page.pdf").write_bytes(page.pdf())
    if shutil.which("pdftotext"):
        words = subprocess.run(["pdftotext", "-layout", tmp_path / "page.pdf", "-"],
                               capture_output=True, text=True, check=True).stdout  # fmt: skip
        lanes = words[words.index("States over time") : words.index("Changes\n")]
        assert all(f"room {n}\n" in lanes for n in (1, 100, 101, 250))
        sheets = [sheet for sheet in lanes.split("\f") if sheet.count("room ") > 30]
        assert len(sheets) >= 3
        assert all("22:40" in sheet and "22:50" in sheet for sheet in sheets)

    shown(page, tmp_path, sl.read(RECORDINGS / "office"))
    assert page.evaluate("document.getElementById('lane-page') === null")


def lanes_shown(page: Page) -> list[int]:
    found = page.evaluate(
        "[...document.querySelectorAll('.lane[data-id]')].filter(e => e.offsetHeight)"
        ".map(e => +e.dataset.id)"
    )
    return list(found)


@pytest.mark.slow
def test_a_typical_week_has_the_colours_of_its_hours(page: Page, tmp_path: Path) -> None:
    """Monday's first hour at the upper left; what nobody has seen is left to the hatching below."""
    data = shown(page, tmp_path, sl.read(RECORDINGS / "clinic_week"))
    door = data["doors"][0]

    pixels = page.evaluate(
        "[...document.querySelector('figure[data-id=\"1\"] canvas').getContext('2d')"
        ".getImageData(0, 0, 24, 7).data]"
    )

    expected = [
        [0, 0, 0, 0] if percent < 0 else [*bytes.fromhex(data["shades"][percent][1:]), 255]
        for percent in door["week"]
    ]
    assert expected == [pixels[4 * i : 4 * i + 4] for i in range(168)]


def test_a_day_that_a_country_left_out_is_no_trap(page: Page, tmp_path: Path) -> None:
    """Samoa went from 29 to 31 December 2011."""
    log = log_between(tmp_path / "log", "Pacific/Apia", "2011-12-28T12:00", "2012-01-02T12:00")

    shown(page, tmp_path, log)

    days = [said for said in axis_labels(page) if ":" not in said]
    assert ["Thu 29 Dec", "Sat 31 Dec", "Sun 1 Jan", "Mon 2 Jan"] == days


def log_between(path: Path, tz: str, first: str, last: str) -> sl.DoorLog:
    """A log of a door that was opened at one moment and closed at another."""
    with sl.create(path, tz=tz, clock=SteadyClock(2 * START)) as log:
        door = log.add_door(x=0, y=0, theta=0, width=1, state="open", at=first)
        log.observe(door, "closed", at=last)
    return sl.read(path)


def test_an_empty_log_says_what_to_do(page: Page, tmp_path: Path) -> None:
    """And a part of a log in which nothing happened says just that."""
    sl.create(tmp_path / "log", tz="UTC").close()
    shown(page, tmp_path, sl.read(tmp_path / "log"))
    empty = page.evaluate("document.getElementById('empty').innerText")

    small = log_between(tmp_path / "small", "UTC", "2026-03-02T08:00", "2026-03-02T09:00")
    shown(page, tmp_path, small, until="2026-03-01T00:00")

    assert f"semmap-log import {tmp_path / 'log'} FILE" in empty
    said = page.evaluate("document.getElementById('empty').innerText")
    assert "There are no events in this part of the log: nothing to draw." == said


def axis_labels(page: Page) -> list[str]:
    """What is written along the lanes, from left to right; no text lies on another, or is cut."""
    found = page.evaluate(
        "[...document.querySelectorAll('#ticks span')].map(e => [e, e.getBoundingClientRect()])"
        ".map(([e, b]) => [e.textContent, b.left, b.right])"
    )
    end = page.evaluate("document.getElementById('ticks').getBoundingClientRect().right")
    edges = [edge for _, left, right in found for edge in (left, right)]
    assert edges == sorted(edges)
    assert not edges or edges[-1] <= end
    return [said for said, *_ in found]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width", "length"), [(390, "3h"), (1440, "3h"), (700, "3 days"), (390, "2 years")]
)
def test_labels_of_the_time_axis_lie_beside_each_other(
    tmp_path: Path, width: int, length: str
) -> None:
    """As the browser draws them; around the end of daylight saving, when some are longer."""
    first, last = {
        "3h": ("2026-11-01T00:10", "2026-11-01T02:30"),
        "3 days": ("2026-10-30T12:00", "2026-11-02T12:00"),
        "2 years": ("2025-02-03T12:00", "2026-11-20T12:00"),
    }[length]
    log = log_between(tmp_path / "log", "America/New_York", first, last)
    with a_page(size=(width, 800)) as page:
        shown(page, tmp_path, log)

        said = axis_labels(page)

    assert len(said) >= (2 if width == 390 else 4)
    assert ("01:00 \N{MINUS SIGN}05:00" in said) == (length == "3h")


@pytest.mark.slow
def test_a_day_of_25_hours_is_left_by_its_buttons(page: Page, tmp_path: Path) -> None:
    """And shown whole; a week that reaches beyond the log has its days where they will be."""
    log = log_between(tmp_path / "log", "America/New_York", "2026-10-20T00:30", "2026-10-30T12:00")
    data = shown(page, tmp_path, log)
    page.evaluate("document.querySelector('[data-window=week]').click()")
    week = page.evaluate("[...document.querySelectorAll('#grid .midnight')]"
                         ".map(e => parseFloat(e.style.left))")  # fmt: skip

    assert data["offsets"][-1] == [1_793_512_800_000, -5 * 3600]
    assert [round(100 * 24 * n / 169, 3) for n in range(7)] == [round(each, 3) for each in week[:7]]

    shown(page, tmp_path, log_between(
        tmp_path / "other", "America/New_York", "2026-10-25T12:00", "2026-11-04T12:00"),
        "#t=2026-11-01T00:30:00-04:00")  # fmt: skip
    page.evaluate("document.querySelector('[data-window=day]').click()")
    day = axis_labels(page)
    page.evaluate("document.querySelector('[aria-label=Later]').click()")

    assert ["Sun 1 Nov", "22:00"] == [day[0], day[-1]]
    assert "00:30:00 Mon 2 Nov 2026" == page.evaluate(
        "document.getElementById('clock').textContent")  # fmt: skip
    assert "Mon 2 Nov" == axis_labels(page)[0]


@pytest.mark.slow
def test_an_hour_begins_when_the_buildings_clocks_say_so(page: Page, tmp_path: Path) -> None:
    """Whenever the log began, and though the zone is half an hour off the others."""
    log = log_between(tmp_path / "log", "Asia/Kolkata", "2026-03-02T08:17", "2026-03-02T12:43")
    shown(page, tmp_path, log)

    page.evaluate("document.querySelector('[data-window=hour]').click()")

    assert ["12:00", "12:55"] == [axis_labels(page)[0], axis_labels(page)[-1]]


def test_the_last_changes_tell_apart_what_the_clocks_show_twice(page: Page, tmp_path: Path) -> None:
    """In the hour that comes twice each time has its offset."""
    with sl.create(tmp_path / "log", tz="Europe/Vienna") as log:
        door = log.add_door(name="front", x=1, y=1, theta=0, width=1, at="2025-10-26T01:30")
        for state, offset in (("open", "+02:00"), ("closed", "+01:00")):
            log.observe(door, state, at=f"2025-10-26T02:30:00{offset}")
    shown(page, tmp_path, sl.read(tmp_path / "log"), "#t=2025-10-26T02:30:00+01:00")

    times = page.evaluate(
        "[...document.querySelectorAll('#changes tbody tr')]"
        ".map(row => row.querySelector('button').textContent)"
    )

    assert ["26 Oct 02:30:00 +01:00", "26 Oct 02:30:00 +02:00"] == times[:2]
    assert {"26 Oct 01:30:00"} == set(times[2:])
    assert "02:30:00 Sun 26 Oct 2025" == page.evaluate(
        "document.getElementById('clock').textContent")  # fmt: skip


def test_a_door_that_was_not_seen_since_is_shown_so(page: Page, tmp_path: Path) -> None:
    """
    In its lane, on the plan, in the table and in words, from three hours after the last look on.
    """
    data = shown(page, tmp_path, watched_log(tmp_path / "log"))
    (door,) = data["doors"]
    lapsed_at = door["lapses"][0]
    page.click(".lane[data-id='1'] button")
    page.wait_until("document.querySelector('.lane[data-id] path')")
    cell = "document.querySelector('tr[data-id=\"1\"] .of-state').textContent"
    pale = "document.querySelector('.door[data-id=\"1\"]').classList.contains('lapsed')"

    told = []
    for t in (lapsed_at - 1, lapsed_at):
        go_to(page, t)
        beside = page.evaluate("document.getElementById('beside').textContent")
        told.append(
            (page.evaluate(cell), page.evaluate(pale), "a sighting holds for 3 h" in beside)
        )

    assert [("Closed", False, False), ("Closed, not seen since", True, True)] == told
    lane = page.evaluate("document.querySelector('.lane[data-id=\"1\"] svg').ariaLabel")
    share = "open 75 % of the time in which that was known, not seen for"
    assert f"front: {share}" in lane
    drawn = page.evaluate(
        "[...document.querySelectorAll('.lane[data-id] path')].map(p => p.getAttribute('class'))"
    )
    assert ["closed lapsed", "open", "closed"] == drawn


def test_what_is_said_of_the_end_says_so(page: Page, tmp_path: Path) -> None:
    """P(open) does not follow the slider: its head says of when it is, at any width."""
    log = watched_log(tmp_path / "log")
    head = "document.querySelector('th.of-p button').textContent"
    shown(page, tmp_path, log)
    whole = page.evaluate(head)

    shown(page, tmp_path, log, until=START + 3600 * 10**9)

    assert "P(open) at the end of the log" == whole
    assert "P(open) at the end of the page" == page.evaluate(head)


@pytest.mark.slow
def test_a_typical_week_names_its_days(page: Page, tmp_path: Path) -> None:
    """Each beside its row of the map."""
    shown(page, tmp_path, sl.read(RECORDINGS / "clinic_week"))

    _left, top, _width, height = page.place("figure[data-id='1'] .week")
    rows = page.evaluate(
        "[...document.querySelectorAll('figure[data-id=\"1\"] .days span')]"
        ".map(s => [s.textContent, (b => (b.top + b.bottom) / 2)(s.getBoundingClientRect())])"
    )
    assert ["Mo", "Tu", "We", "Th", "Fr", "Sa", "Su"] == [name for name, _ in rows]
    for place, (_, middle) in enumerate(rows):
        assert abs(middle - (top + (place + 0.5) * height / 7)) < 3
