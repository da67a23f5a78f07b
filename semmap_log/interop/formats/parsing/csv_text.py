r"""Texts in CSV files that do nothing to whoever opens them, and come back as they were.

A spreadsheet takes a cell that begins with = + - or @ for a formula, and a terminal obeys control
characters. So of a text in our CSV files

- one that begins so, behind blanks and apostrophes or none, gets an apostrophe before it: `'=1+1`;
- control characters, and those that turn the direction of writing, are written as `\u001b`, and a
  backslash that stands before such a code as `\u005c`;
- blanks at its ends are written as `\u0020`: those around a cell do not count.

Reading takes just these back; any other text is what it says.
"""

from __future__ import annotations

import re

_FORMULA = re.compile(r"['\s]*[=+\-@\uff1d\uff0b\uff0d\uff20]")
"""Wide ones count in Excel, too."""
_STEERING = "\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
_CODE = (
    r"u(?:00[01][0-9a-f]|0020|007f|00[89][0-9a-f]|00a0|005c|061c|1680|200[0-9aef]|202[89a-f]|205f"
    r"|206[6-9]|3000)"
)
_TO_WRITE = re.compile(rf"[{_STEERING}]|\\(?={_CODE})|\A\s+|\s+\Z")
_TO_READ = re.compile(rf"\\(?={_CODE})u(....)")


def harmless(text: str) -> str:
    """Return how a text is written."""
    if _FORMULA.match(text):
        text = f"'{text}"
    return _TO_WRITE.sub(lambda found: "".join(f"\\u{ord(c):04x}" for c in found[0]), text)


def is_written_otherwise(text: str) -> bool:
    """Tell whether a text, as it is read, means another one."""
    return text.startswith("'") or "\\u" in text


def meant(text: str) -> str:
    """Return the text that was written so; blanks around it do not count."""
    text = text.strip()
    if not is_written_otherwise(text):
        return text
    text = _TO_READ.sub(lambda found: chr(int(found[1], 16)), text)
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text
