"""Writes what `EventBatch.of` takes into batches/columnar_events.py, from the table of events.

python tools/batch_columns.py

Editors and type checkers read signatures, which cannot be made while a program runs: so they stand
there, and a test compares them with the table.
"""

from __future__ import annotations

from pathlib import Path

from semmap_log.core.messages import OBJECT_KINDS
from semmap_log.core.model.events import KINDS, Event, defaults_of, field_names

MODULE = Path(__file__).parents[1] / "semmap_log" / "core" / "batches" / "columnar_events.py"
IMPORT, END_OF_IMPORT = "from semmap_log.core.model.events import (\n", ")\n"
FIRST, END = "    @overload\n", "    @classmethod\n    def of(\n        cls, kind: type[Event], *,"


def written() -> str:
    """Return the text of the module, its overloads made anew."""
    text = MODULE.read_text(encoding="utf-8")
    kinds = [kind for kind in KINDS if kind.kind not in OBJECT_KINDS]
    start = text.index(IMPORT) + len(IMPORT)
    others = {name.strip() for name in text[start : text.index(END_OF_IMPORT, start)].split(",")}
    others -= {"", *(kind.__name__ for kind in KINDS)}
    # constants, classes, functions: as ruff sorts them
    names = sorted(
        {*others, *(kind.__name__ for kind in kinds)},
        key=lambda name: (not name.isupper(), not name[0].isupper(), name),
    )
    imports = "".join(f"    {name},\n" for name in names)
    text = _replaced(text, IMPORT, END_OF_IMPORT, IMPORT + imports)
    return _replaced(text, FIRST, END, "".join(map(_overload, kinds)))


def _replaced(text: str, first: str, end: str, new: str) -> str:
    """Return a text with what stands from one piece up to another written anew."""
    start = text.index(first)
    return text[:start] + new + text[text.index(end, start) :]


def _overload(kind: type[Event]) -> str:
    """Return what makes batches of a kind: what must be told, and then what may be left out."""
    defaults = defaults_of(kind)
    names = sorted(field_names(kind), key=lambda name: name in defaults)
    columns = "".join(
        f"        {name}: ArrayLike{' = ...' if name in defaults else ''},\n" for name in names
    )
    return (
        "    @overload\n"
        "    @classmethod\n"
        "    def of(\n"
        "        cls,\n"
        f"        kind: type[{kind.__name__}],\n"
        "        *,\n"
        "        happened_ns: ArrayLike | None = None,\n"
        f"{columns}"
        "    ) -> Self: ...\n\n"
    )


if __name__ == "__main__":
    MODULE.write_text(written(), encoding="utf-8")
