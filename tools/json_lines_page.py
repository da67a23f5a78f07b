"""Writes docs/json_lines.md: the kinds and keys of JSON lines, from the table of events.

python tools/json_lines_page.py
"""

from __future__ import annotations

from pathlib import Path

from semmap_log.interop.formats.json.trip_json import OF_EVERY_KIND, document

PAGE = Path(__file__).parents[1] / "docs" / "json_lines.md"

HEAD = f"""\
# JSON lines

One event is one JSON object on one line: what `record` and `import` take, and what
`tail --json` and `export … events.jsonl` write; `history --json` has the same objects in a list.
This page is made from the table of events by `python tools/json_lines_page.py`; a test compares
the two.

```json
{{"kind": "DoorObserved", "door": "front", "state": "OPEN", "accuracy": 0.9}}
{{"kind": "RobotPose", "x": 1.0, "y": 2.0, "theta": 0.0}}
```

`kind` is needed. Every kind may have {", ".join(f"`{name}`" for name in OF_EVERY_KIND)}:
when it happened, who did it, by which sensor or file, why, what it belongs to, and 32
hexadecimal digits by which a line that is sent again is stored once. A time is ISO-8601 text
(without an offset: in the log's zone) or a number: seconds since 1970, nanoseconds from 18 digits
on. `null` stands for a number that is not known. A key that a kind does not have is an error.

An export has more keys, by which `import` makes the same log again: `event` and `recorded` (its
number and when it was recorded), `commit` (first and last number, where a commit has several
events), `content` (the digest of its command), and `retracted` of an event that was taken back.
A commit is known from the same moment on as there, also if its first events are gone.
Its first line has `timezone`, the log's: `import` into a log of another zone says so.

"""


def page() -> str:
    """Return the text of the page."""
    return HEAD + document()


if __name__ == "__main__":
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text(page(), encoding="utf-8")
