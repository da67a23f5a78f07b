"""The tests' own browser: it sees, hears and touches what a person would, and is gone after."""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from tests.browser import ANSWER_S, Page, a_page, as_url

HTML = """<!doctype html><title>t</title>
<style>body { margin: 0; background: rgb(255, 255, 255) }
@media (prefers-color-scheme: dark) { body { background: rgb(0, 0, 0) } }</style>
<input type=range id=slider min=0 max=100 value=0 style="width: 300px">
<button id=button onclick="document.title = 'clicked'">b</button>
"""


@pytest.fixture
def page() -> Iterator[Page]:
    with a_page(size=(640, 480)) as page:
        yield page


@pytest.fixture
def html(tmp_path: Path) -> str:
    (tmp_path / "page.html").write_text(HTML)
    return as_url(tmp_path / "page.html")


@pytest.mark.slow
def test_a_page_is_touched_and_seen(page: Page, html: str) -> None:
    """A click, a key and a drag arrive; the picture has the size and the theme asked for."""
    page.open(html)

    page.click("#button")
    page.click("#slider")
    page.press("Home", "ArrowRight", "ArrowRight")
    stepped = page.evaluate("slider.value")
    left, top, width, height = page.place("#slider")
    page.drag((left + 8, top + height / 2), (left + width * 0.75, top + height / 2))
    page.resize(320, 200)
    page.prefer(dark=True)

    assert "clicked" == page.evaluate("document.title")
    assert "2" == stepped
    assert 70 < int(page.evaluate("slider.value")) < 80
    picture = Image.open(io.BytesIO(page.screenshot()))
    assert ((320, 200), (0, 0, 0)) == (picture.size, picture.convert("RGB").getpixel((310, 190)))
    assert page.pdf().startswith(b"%PDF")
    assert [] == page.complaints
    assert [html] == page.requests


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "complaint"),
    [
        ("console.error('a', 1)", "error: a 1"),
        ("setTimeout(() => { nowhere() }, 0)", "nowhere is not defined"),
        ("fetch('file:///nowhere').catch(() => 0)", "failed: Fetch"),
    ],
)
def test_what_goes_wrong_in_a_page_is_told(
    page: Page, html: str, script: str, complaint: str
) -> None:
    """A word on the console, an exception that nobody catches, a request that fails."""
    page.open(html)

    page.evaluate(f"void {script}" if script.startswith("set") else script)
    deadline = time.monotonic() + ANSWER_S
    while not any(complaint in each for each in page.complaints):
        assert time.monotonic() < deadline, page.complaints
        page.wait(0.1)


@pytest.mark.slow
def test_the_browser_ends_with_the_block() -> None:
    """An error inside leaves none behind."""
    lines = []

    def fail() -> None:
        with a_page() as page:
            lines.append(page._line)
            raise RuntimeError("ours")

    with pytest.raises(RuntimeError, match="ours"):
        fail()
    assert lines[0].process.poll() is not None
