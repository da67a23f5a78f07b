"""Text that the rerun viewer can draw, and names that can be part of an entity path.

The viewer has one font (Inter) and no other to fall back on: a character outside it is drawn as a
box on the screen, and ends a headless viewer with a panic. So such characters become boxes here,
and a name of which nothing else is left gives way to the door's number.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Collection, Iterable

BOX = "□"
"""Stands for a character that the viewer cannot draw."""

LONGEST_PART = 40

_DRAWN = (
    (0x20, 0x7E), (0xA0, 0x148), (0x14A, 0x1C3),  # Latin
    (0x384, 0x38A), (0x38C, 0x38C), (0x38E, 0x3A1), (0x3A3, 0x3E1),  # Greek
    (0x400, 0x49D), (0x4A0, 0x4FF),  # Cyrillic
    (0x1E00, 0x1EFF),  # Latin with more accents, as in Vietnamese
    (0x2010, 0x2027), (0x2030, 0x205E), (0x20A0, 0x20BF), (0x2190, 0x2199), (0x25A1, 0x25A1),
)  # fmt: skip
"""What Inter holds in rerun 0.41, without its rarer corners: first and last code point, each."""


def drawable(text: str) -> str:
    """Return the text with a box for each character that the viewer's font does not have."""
    if text.isascii() and text.isprintable():
        return text
    composed = unicodedata.normalize("NFC", text)
    return "".join(character if _is_drawn(character) else _stand_in(character)
                   for character in composed)  # fmt: skip


def has_letters(text: str) -> bool:
    """Tell whether anything is left to read once the text has been made drawable."""
    return any(character.isalnum() for character in drawable(text))


def path_part(text: str) -> str:
    """Return the text as part of an entity path that the viewer shows without escapes.

    Letters, digits, `.`, `-` and `_` stay, as many as a lane's head has room for; whatever else is
    between them becomes one `_`.
    """
    kept = [character if character.isalnum() or character in ".-_" else " "
            for character in drawable(text)]  # fmt: skip
    return "_".join("".join(kept).split())[:LONGEST_PART].strip(".-_")


def unique_parts(names: Iterable[tuple[int, str]]) -> dict[int, str]:
    """Return a path part for each (door id, name): readable, and each a different one.

    A name that nothing is left of becomes `door_<id>`; where two would be the same, in any case
    of letters, all but the first get their id behind.
    """
    parts: dict[int, str] = {}
    taken: set[str] = set()
    for door_id, name in sorted(names):
        parts[door_id] = free_part(door_id, name, taken)
        taken.add(parts[door_id].casefold())
    return parts


def free_part(door_id: int, name: str, taken: Collection[str]) -> str:
    """Return the path part for a name, or one with the id behind if it is taken (case folded)."""
    part = path_part(name) or f"door_{door_id}"
    while part.casefold() in taken:
        part = f"{part}_{door_id}"
    return part


def _is_drawn(character: str) -> bool:
    code = ord(character)
    return any(first <= code <= last for first, last in _DRAWN)


def _stand_in(character: str) -> str:
    return " " if character.isspace() or unicodedata.category(character) == "Cc" else BOX
