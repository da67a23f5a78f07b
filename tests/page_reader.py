"""The program that ends the page of the log format, as an oracle: it shares no code with ours."""

from __future__ import annotations

from typing import Any

from doc_pages import ROOT, blocks_of

PAGE = (ROOT / "docs" / "log_format.md").read_text(encoding="utf-8")
(READER,) = [block.text for block in blocks_of(PAGE) if block.language == "python"]


def page_reader() -> Any:
    """Return `read_log` of the page's program."""
    names: dict[str, Any] = {"__name__": "page"}
    exec(READER, names)
    return names["read_log"]


READ = page_reader()
"""Returns the log in a folder: `events`, `commits`, `hash`."""
