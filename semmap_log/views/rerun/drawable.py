"""Text that the rerun viewer can draw, and names that can be part of an entity path.

The viewer has one font (Inter) and no other to fall back on: a character outside it is drawn as a
box on the screen, and ends a headless viewer with a panic. The font has Latin, Greek and Cyrillic
letters; no Chinese, Japanese or Korean ones, no Arabic, Hebrew, Thai or Indian ones, and few
emoji. So a name with such a letter gives way to a number, and in other text they become boxes.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Collection, Iterable

from semmap_log.views import drawable_names

BOX = "□"
"""Stands for a character that the viewer cannot draw."""

LONGEST_PART = 40

_FONT = """
20-7e a0-ac ae-148 14a-1c3 1c5-31e 321-377 37a-37f 384-38a 38c 38e-3a1 3a3-3e1 3f0-49d 4a0-4ff 52f
e3f 1d43 1d47-1d49 1d4d 1d4f-1d50 1d52 1d56-1d58 1d5b 1d62-1d65 1d9c 1da0 1dbb 1dbf-1df5 1dfc-1f15
1f18-1f1d 1f20-1f45 1f48-1f4d 1f50-1f57 1f59 1f5b 1f5d 1f5f-1f7d 1f80-1fb4 1fb6-1fc4 1fc6-1fd3
1fd6-1fdb 1fdd-1fef 1ff2-1ff4 1ff6-1ffe 2000-200a 2010-2027 202f-205f 2070-2071 2074-208e 2090-209c
20a0-20bf 20db-20de 20e8 20f0 2100-2101 2103 2105-2106 2109 2113 2116-2117 211e-2123 2126 212a-212b
212e 2132 213b 214d 214f 2153 215a-2188 2190-2199 21a9-21aa 21b0-21b1 21b3-21b5 21ba-21bb 21d0 21d2
21d4 21de-21df 21e4-21e5 21e7 21ea 2202 2205-2206 220f 2211-2212 221a 221e 222b 2248 2260 2264-2265
2303 2305 2318 2325-2327 232b 2380 2387 238b 23ce-23cf 2423 2460-2468 24b6-24cf 24ea 25a0-25a2 25aa
25b2-25b3 25b6-25b7 25ba-25bd 25c0-25c1 25c4-25c7 25ca-25cb 25cf 25e6 25ef 2600 2605-2606 263c 2661
2665 26a0 2713 2717 2756 2764 2780-2788 27ef 27f5-27fa 2b06 2b12-2b13 2b1c 2c7c 2c7f 2dff 2e18 a69f
a7ff a92e fe20-fe2d 1f12f-1f149 1f16a-1f16b 1f850 1f852
"""
"""What Inter holds in rerun 0.41, hexadecimal, without controls and characters for private use."""


def _ranges() -> list[tuple[int, int]]:
    ends = [part.split("-") for part in _FONT.split()]
    return [(int(pair[0], 16), int(pair[-1], 16)) for pair in ends]


_DRAWN = _ranges()


def drawable(text: str) -> str:
    """Return the text with a box for each character that the viewer's font does not have."""
    if text.isascii() and text.isprintable():
        return text
    composed = unicodedata.normalize("NFC", text)
    return "".join(character if _is_drawn(character) else _stand_in(character)
                   for character in composed)  # fmt: skip


def drawable_name(name: str, stand_in: str) -> str:
    """Return a name as the viewer can draw it; what stands for it if a letter is missing."""
    return drawable_names.drawable_name(name, stand_in, _is_drawn)


def is_drawable_name(name: str) -> bool:
    """Tell whether a name can be drawn, so that nothing needs to stand for it."""
    return drawable_name(name, "") != ""


def path_part(text: str) -> str:
    """Return the text as part of an entity path that the viewer shows without escapes.

    Letters, digits, `.`, `-` and `_` stay, as many as a lane's head has room for; whatever else is
    between them becomes one `_`. Nothing stays of a name that the viewer cannot draw.
    """
    kept = [character if character.isalnum() or character in ".-_" else " "
            for character in drawable_name(text, "")]  # fmt: skip
    return "_".join("".join(kept).split())[:LONGEST_PART].strip(".-_")


def unique_parts(names: Iterable[tuple[int, str]], what: str = "door") -> dict[int, str]:
    """Return a path part for each (number, name): readable, and each a different one.

    A name that nothing is left of becomes `<what>_<number>`; where two would be the same, in any
    case of letters, all but the first get their number behind.
    """
    parts: dict[int, str] = {}
    taken: set[str] = set()
    for number, name in sorted(names):
        parts[number] = free_part(number, name, taken, what)
        taken.add(parts[number].casefold())
    return parts


def free_part(number: int, name: str, taken: Collection[str], what: str = "door") -> str:
    """Return the path part for a name, with the number behind if it is taken (case folded)."""
    part = path_part(name) or f"{what}_{number}"
    while part.casefold() in taken:
        part = f"{part}_{number}"
    return part


def _is_drawn(character: str) -> bool:
    code = ord(character)
    return any(first <= code <= last for first, last in _DRAWN)


def _stand_in(character: str) -> str:
    return " " if character.isspace() or unicodedata.category(character) == "Cc" else BOX
