"""A building that was mapped anew, on the page: each moment lies on the plan of its time."""

from __future__ import annotations

import base64
import io
from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import semmap_log as sl
from semmap_log.views.report.content import report
from tests.browser import a_page
from tests.turned_maps import MOVED_AT, OFFICE, SHIFT_M, office_mapped_anew
from tests.views.report.pages import MS, data_of


@pytest.fixture
def anew(tmp_path: Path) -> sl.DoorLog:
    return sl.read(office_mapped_anew(tmp_path))


def is_in(bounds: list[float], x: float, y: float) -> bool:
    return bounds[0] <= x <= bounds[2] and bounds[1] <= y <= bounds[3]


def test_a_level_has_a_plan_for_each_time(anew: sl.DoorLog) -> None:
    """Picture, rooms and bounds; doors and robots of a time lie within those of its plan."""
    data = data_of(report(anew).html)

    (level,) = data["levels"]
    (old,) = level["earlier"]
    begin = anew.instant(MOVED_AT) // MS - data["begin"]
    assert (old["since"] <= 0, level["since"]) == (True, begin)
    (before,) = data_of(report(sl.read(OFFICE)).html)["levels"]
    assert (old["floor"], old["bounds"]) == (before["floor"], before["bounds"])
    assert old["rooms"] == before["rooms"]
    assert picture(level).size == picture(old).size[::-1]
    for door in data["doors"]:
        for since, _, x, y, *_ in door["places"]:
            plan = level if since >= begin else old
            assert is_in(plan["bounds"], x, y), (door, since)
    for number, *deltas in data["track"]:
        times, xs, ys = (list(accumulate(deltas[i::3])) for i in range(3))
        of = {100 * t >= begin for t in times}
        assert (number, len(of)) == (1, 1), "a run that goes from one plan to another"
        plan = level if of.pop() else old
        assert all(is_in(plan["bounds"], x / 10, y / 10) for x, y in zip(xs, ys, strict=True))


def picture(plan: dict[str, Any]) -> Image.Image:
    return Image.open(io.BytesIO(base64.b64decode(plan["floor"]["src"].split(",")[1])))


def test_one_plan_is_told_as_ever(anew: sl.DoorLog) -> None:
    """In a part of the log that has one."""
    data = data_of(report(anew, since="2026-03-02T15:00").html)

    assert "earlier" not in data["levels"][0]
    assert data["levels"][0]["bounds"][0] > SHIFT_M[0] - 5


@pytest.mark.slow
def test_the_page_changes_its_plan(anew: sl.DoorLog, tmp_path: Path) -> None:
    """With the slider, there and back; nobody knows where the robot is until it tells it anew."""
    page_file = tmp_path / "page.html"
    page_file.write_text(report(anew).html)

    begin_ms = data_of(page_file.read_text())["begin"]
    with a_page() as page:
        page.open(page_file.as_uri())
        seen = []
        for at in ("13:59:59", "14:00:00", "15:12:00", "13:00:00"):
            moment = anew.instant(f"2026-03-02T{at}") // MS - begin_ms
            page.evaluate(
                f"(s => {{ s.value = {moment}; s.dispatchEvent(new Event('input')) }})"
                "(document.getElementById('slider'))"
            )
            page.let_draw()
            seen.append(page.evaluate(
                "[[...document.querySelectorAll('.floor')].map(e => !e.classList.contains('gone')),"
                "!document.querySelector('.robot').classList.contains('gone')]"
            ))  # fmt: skip
        assert page.complaints == []

    assert seen == [
        [[True, False], True], [[False, True], False], [[False, True], True], [[True, False], True],
    ]  # fmt: skip
