"""Names in a picture whose fonts lack letters of some: a whole name, or what stands for it."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable

HasShape = Callable[[str], bool]
"""Tells whether the fonts of a picture have a shape for a character."""


def drawable_name(name: str, stand_in: str, has_shape: HasShape) -> str:
    """Return a name as it can be drawn; what stands for it if a letter is missing.

    Of a name in part drawn nobody could tell which door it is: two rooms may differ in just the
    letters that are missing. Other signs, such as emoji, are left out.
    """
    composed = unicodedata.normalize("NFC", name)
    if any(unicodedata.category(c)[0] in "LMN" and not has_shape(c) for c in composed):
        return stand_in
    kept = " ".join("".join(c if has_shape(c) else " " for c in composed).split())
    return kept if any(map(str.isalnum, kept)) else stand_in
