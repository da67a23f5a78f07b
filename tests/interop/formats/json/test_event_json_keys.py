"""Help and page about JSON lines say what the reader takes: they are made from the same table."""

from __future__ import annotations

from json_lines_page import PAGE, page

from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import KINDS
from semmap_log.interop.formats.json.event_json_reader import DoorLookup, parse_event_line
from semmap_log.interop.formats.json.trip_json import OF_EVERY_KIND, help_text, kinds_and_keys
from semmap_log.interop.formats.parsing.foreign_file import FileOrder

VALUES = {
    "door_id|door": ("door_id", "7"), "state": ("state", '"OPEN"'), "name": ("name", '"x"'),
    "class_name": ("class_name", '"dock"'), "geometry": ("geometry", '"point"'),
    "key": ("key", '"k"'), "value": ("value", '"v"'), "passed": ("passed", "true"),
    "at": ("at", '"2026-03-01T00:00Z"'), "format": ("format", '"yaml"'),
    "file_name": ("file_name", '"x.yaml"'), "cells_zlib_base64": ("", ""),
    "changed": ("changed", '["WIDTH"]'), "width": ("width", "1"),
    "reasons": ("reasons", '"thinned"'), "rule": ("rule", '"poses"'),
    "tombstones": ("tombstones", '""'),
}  # fmt: skip
LOOKUP = DoorLookup(lambda _: DoorId(7), lambda: DoorId(8), lambda _: 0, lambda _: 0)


def test_the_page_is_up_to_date() -> None:
    """Else: python tools/json_lines_page.py."""
    assert page() == PAGE.read_text(encoding="utf-8")


def test_help_names_every_kind_and_every_key() -> None:
    """In 80 columns."""
    text = help_text()
    words = text.replace("[", "").replace("]", "").split()

    assert max(map(len, text.splitlines())) < 80
    assert {kind.__name__ for kind in KINDS} <= {*words}
    for _, _, keys in kinds_and_keys():
        assert {key.name for key in keys} <= {*words}
    assert {*OF_EVERY_KIND} <= {*words}


def test_a_line_of_the_needed_keys_alone_is_read() -> None:
    """Of every kind; and without any one of them it is not."""
    for kind, _, keys in kinds_and_keys():
        if kind == "FloorMap":
            continue
        needed = [VALUES.get(key.name, (key.name, "1")) for key in keys if not key.is_optional]
        if kind == "DoorUpdated":
            needed.append(VALUES["width"])
        line = _line(kind, needed)

        assert (
            kind
            == type(parse_event_line(line, order=FileOrder("UTC"), lookup=LOOKUP).event).__name__
        )
        for left_out in needed:
            shorter = _line(kind, [pair for pair in needed if pair != left_out])
            assert _is_refused(shorter), shorter


def _line(kind: str, pairs: list[tuple[str, str]]) -> str:
    said = "".join(f', "{name}": {value}' for name, value in pairs)
    return f'{{"kind": "{kind}"{said}}}'


def _is_refused(line: str) -> bool:
    try:
        parse_event_line(line, order=FileOrder("UTC"), lookup=LOOKUP)
    except ValueError:
        return True
    return False
