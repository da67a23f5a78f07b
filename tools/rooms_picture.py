"""Draws the rooms of `semmap_log/` and what each imports, for docs/architecture.md.

    python tools/rooms_picture.py        # writes docs/images/rooms.svg

The picture has a row for each room, with the first line of its docstring, and a dot for each room
that it imports from; the dot's size shows how many imports there are, by powers of ten.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from xml.sax.saxutils import escape

from house import modules_of

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "images" / "rooms.svg"
ROOMS = ("core", "store", "log", "analysis", "fleet", "views", "interop", "live", "cli")
"""From the bottom up."""
KERNEL = ROOMS[:3]
ROW, COLUMN, TEXT, TOP = 40, 60, 660, 44
STYLE = """
text { font: 14px sans-serif; fill: #222; } .name { font-weight: bold; } .head { fill: #555; }
rect { fill: #eef2f7; stroke: #8899aa; } .kernel { fill: #dbe9dc; } circle { fill: #33608c; }
"""


def picture(checkout: Path) -> str:
    """Return the picture of a checkout's rooms, as SVG."""
    purposes, arrows = _rooms_of(checkout)
    rows = list(reversed(ROOMS))
    width, height = TEXT + COLUMN * len(ROOMS[:-1]), TOP + ROW * len(ROOMS) + 36
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">',
        f'<rect width="{width}" height="{height}" style="fill: white; stroke: none"/>',
        f"<style>{STYLE}</style>",
        *(_text(_x(room), TOP - 14, room, "head", anchor="middle") for room in ROOMS[:-1]),
    ]
    for row, room in enumerate(rows):
        y = TOP + ROW * row
        kind = "kernel" if room in KERNEL else "room"
        lines += [
            f'<rect class="{kind}" x="8" y="{y}" width="{TEXT - 16}" height="{ROW - 6}" rx="5"/>',
            _text(18, y + 22, room, "name"),
            _text(96, y + 22, purposes[room], "purpose"),
        ]
        for other in ROOMS[:-1]:
            if count := arrows[room, other]:
                radius = 2 + 4 * len(str(count))
                lines.append(f'<circle cx="{_x(other)}" cy="{y + 17}" r="{radius}"/>')
    legend = "A dot: the room of the row imports from the room of the column. Green: the kernel."
    return "\n".join([*lines, _text(18, height - 14, legend, "head"), "</svg>", ""])


def _rooms_of(checkout: Path) -> tuple[dict[str, str], Counter[tuple[str | None, str | None]]]:
    """Return each room's purpose, and how many imports lead from one room to another."""
    modules = modules_of(checkout)
    docs = {room: str(modules[f"semmap_log.{room}"].docstrings[0].value) for room in ROOMS}
    pairs = [(modules[n], modules[o]) for n in modules for o in modules[n].imported(modules)]
    arrows = Counter((one.room, other.room) for one, other in pairs if one.room != other.room)
    return {room: text.partition("\n")[0] for room, text in docs.items()}, arrows


def _x(room: str) -> float:
    return TEXT + COLUMN * (ROOMS.index(room) + 0.5)


def _text(x: float, y: float, text: str, kind: str, *, anchor: str = "start") -> str:
    return f'<text x="{x}" y="{y}" class="{kind}" text-anchor="{anchor}">{escape(text)}</text>'


if __name__ == "__main__":
    PICTURE.write_text(picture(ROOT), encoding="utf-8")
    sys.exit(0)
