"""The page's ticks are those of `views/time_axis.py`."""

from __future__ import annotations

import json
from importlib import resources

import pytest

from tests.browser import a_page
from tests.views.test_time_axis import ticks_of
from tests.views.time_spans import axes

PAGE = resources.files("semmap_log.views.report").joinpath("page")


@pytest.mark.slow
def test_the_page_and_python_have_the_same_ticks_in_every_zone() -> None:
    """
    All of them, with their labels, from minutes to ten years.
    """
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
