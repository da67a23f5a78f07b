"""The page's ticks are those of `views/time_axis.py`."""

from __future__ import annotations

import json
from importlib import resources

import pytest

from semmap_log.core.model.moments import format_short
from tests.browser import a_page
from tests.views.test_time_axis import ticks_of
from tests.views.time_spans import axes

PAGE = resources.files("semmap_log.views.report").joinpath("page")


@pytest.mark.slow
def test_the_page_and_python_have_the_same_ticks_in_every_zone() -> None:
    """All of them, with their labels, from minutes to ten years."""
    cases = axes()
    scripts = "\n".join(PAGE.joinpath(name).read_text(encoding="utf-8")
                        for name in ("calendar.js", "ticks.js"))  # fmt: skip
    asked = json.dumps([[c.offsets, c.start_ms, c.end_ms, c.letters, c.short] for c in cases])

    with a_page() as page:
        shown = page.evaluate(
            f"(() => {{ {scripts}\n return {asked}.map(([offsets, start, end, letters, short]) =>"
            " timeTicks(start, end, new WallClock(offsets), letters, short)"
            ".map(({ at, label, beginsDay }) => [at, label, beginsDay])) })()"
        )

    for case, found in zip(cases, shown, strict=True):
        true = [[tick.at_ms, tick.label, tick.begins_day] for tick in ticks_of(case)]
        assert true == found, case


@pytest.mark.slow
def test_the_page_and_python_agree_which_times_come_twice() -> None:
    """Around the changes of every zone's clocks: there, both show the offset."""
    cases = [(c, (c.start_ms + c.end_ms) // 2 // 1000 * 1000) for c in axes()]
    script = PAGE.joinpath("calendar.js").read_text(encoding="utf-8")
    asked = json.dumps([[c.offsets, ms] for c, ms in cases])

    with a_page() as page:
        shown = page.evaluate(
            f"(() => {{ {script}\n return {asked}.map(([offsets, at]) =>"
            " new WallClock(offsets).comesTwice(at)) })()"
        )

    true = [len(format_short(ms * 10**6, c.tz)) > len("2026-03-02 08:00:00") for c, ms in cases]
    assert true == shown
    assert {True, False} == set(true)
