"""Names as every PDDL parser takes them: letters, digits, `-` and `_`, in small letters."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Collection, Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

K = TypeVar("K", bound=Hashable)

MOST_LETTERS = 60

_KEYWORDS = """
    either object number domain problem define and or not forall exists when imply oneof unknown
    increase decrease assign scale-up scale-down minimize maximize total-cost total-time is-
    violated preference at over start end all always sometime within at-most-once sometime-after
    sometime-before always-within hold-during hold-after duration true false undefined total-
    order
"""
KEYWORDS = frozenset(_KEYWORDS.split())
"""Words of PDDL, and of its dialects, that some parser takes for more than a name."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What an object is called by people."""

    kind: str
    """`door`, `room`: begins the names that would begin with no letter."""
    text: str
    """Any text at all, or none."""
    mark: str
    """Tells it from others of that name, such as `3`; letters, digits, `-` and `_`."""


def pddl_names(wanted: Mapping[K, Wanted], taken: Collection[str] = ()) -> dict[K, str]:
    """Return a name for each object, no two alike.

    Those that would be alike, or a word of PDDL, have their kind and mark behind: `hall-door-3`.

    Args:
        wanted: Object -> what it is called; their order decides where even that is not enough.
        taken: Other names that mean something, in small letters.
    """
    plain = {key: plain_name(each) for key, each in wanted.items()}
    bearers = Counter(plain.values())
    used = KEYWORDS | set(taken)
    names = {key: name for key, name in plain.items() if bearers[name] == 1 and name not in used}
    used |= set(plain.values())
    for key, each in wanted.items():
        if key not in names:
            names[key] = _free(f"{plain[key]}-{each.kind}-{each.mark}", used)
            used |= {names[key]}
    return {key: names[key] for key in wanted}


def plain_name(wanted: Wanted) -> str:
    """Return what a name is without what PDDL does not take: `Tür 1` is `tur-1`."""
    parts = unicodedata.normalize("NFKD", wanted.text)
    letters = "".join(letter for letter in parts if not unicodedata.combining(letter)).lower()
    name = re.sub(r"[^a-z0-9_-]+", "-", letters).strip("-_")[:MOST_LETTERS].strip("-_")
    if not name:
        return f"{wanted.kind}-{wanted.mark}"
    return name if name[0].isalpha() else f"{wanted.kind}-{name}"


def _free(name: str, used: Collection[str]) -> str:
    """Return the name, with a number behind it if it is used."""
    number, free = 1, name
    while free in used:
        number += 1
        free = f"{name}-{number}"
    return free
