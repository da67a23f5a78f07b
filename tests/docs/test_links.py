"""Links lead somewhere, also in files that are read outside of the built documentation."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from doc_pages import ROOT

FILES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")),
    ROOT / "recordings" / "README.md",
    *sorted((ROOT / "semmap_log").rglob("README.md")),
    *sorted((ROOT / "tools" / "experiments").rglob("README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.DOTALL | re.MULTILINE)


def _text(path: Path) -> str:
    """Return a page with what it includes."""
    text = path.read_text(encoding="utf-8")
    for name in re.findall(r"^```\{include\} (\S+)", text, flags=re.MULTILINE):
        text += "\n" + (path.parent / name).read_text(encoding="utf-8")
    return text


def _anchors(path: Path) -> set[str]:
    """Return what a link may name of a page: headings, as GitHub and MyST slug them, and labels."""
    text = _text(path)
    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    slugs = {re.sub(r"[^\w -]", "", h.lower()).strip().replace(" ", "-") for h in headings}
    return slugs | set(re.findall(r"^\(([\w-]+)\)=$", text, flags=re.MULTILINE))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path: Path) -> None:
    """Every relative link is a file of the project; what it names of it is a heading there."""
    wrong = []
    for link in _LINK.findall(_CODE.sub("", path.read_text(encoding="utf-8"))):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = path.parent / name if name else path
        if not target.exists() or (anchor and anchor not in _anchors(target)):
            wrong.append(link)

    assert [] == wrong


def test_the_files_that_a_newcomer_is_sent_to_are_there() -> None:
    """CONTRIBUTING.md and the page on the architecture name files in backticks, in their tables."""
    pages = [ROOT / "CONTRIBUTING.md", ROOT / "docs" / "architecture.md"]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    tables = "\n".join(line for line in text.splitlines() if line.startswith("| "))

    named = set(re.findall(r"`(\w[\w./]*(?:/|\.(?:py|md|yaml)))`", tables))

    assert 30 < len(named)
    assert [] == sorted(name for name in named if not _is_there(name))


def _is_there(name: str) -> bool:
    rooms = ROOT / "semmap_log"
    return any((folder / name).exists() for folder in (ROOT, rooms, rooms / "log"))
