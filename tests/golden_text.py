"""What a verb prints, word for word: `golden/wording/VERB.txt`, a part for each case.

`pytest --golden FILE`, without `-n`, rewrites the parts that the tests of a file compare: look
at the difference.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parent / "golden" / "wording"
_TITLE = re.compile(r"^=== (.+) ===\n", re.MULTILINE)


@dataclass(frozen=True)
class GoldenText:
    """Compares texts with golden files; the fixture `golden` is one."""

    temporary: Path
    """A test's own folder; the files name it, and those beside it, TMP."""
    is_rewritten: bool = False
    folder: Path = FOLDER

    def __call__(self, verb: str, case: str, text: str) -> None:
        """Check that a text is what the file of a verb has for a case.

        Raises:
            AssertionError: It is another, or the file has no such case.
        """
        file = self.folder / f"{verb}.txt"
        cases = _cases(file.read_text(encoding="utf-8")) if file.exists() else {}
        folders = re.compile(rf"{re.escape(str(self.temporary.parent))}/[^/\s'\"]+")
        case, got = (folders.sub("TMP", each) for each in (case, text.rstrip("\n") + "\n"))
        if self.is_rewritten:
            cases[case] = got
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(_text(cases), encoding="utf-8")
        assert cases.get(case) == got, f"{file}, case {case!r}: pytest --golden rewrites it"


def _cases(text: str) -> dict[str, str]:
    """Return the texts of a file by their cases."""
    _, *parts = _TITLE.split(text)
    return {case: f"{body.rstrip()}\n" for case, body in zip(parts[::2], parts[1::2], strict=True)}


def _text(cases: dict[str, str]) -> str:
    """Return the text of a file, its cases in order."""
    return "\n".join(f"=== {case} ===\n{cases[case]}" for case in sorted(cases))
