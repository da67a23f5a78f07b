"""What a YAML file is, by its keys: whatever it is called."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from semmap_log.errors import FormatError
from semmap_log.interop.formats.parsing.foreign_file import decode_utf8, read_capped
from semmap_log.interop.formats.parsing.strict_yaml import MOST_BYTES, Mapping, parse_yaml

YamlKind = Literal["building", "map", "doors"]
MAP_KEYS = frozenset({"image", "resolution", "origin", "occupied_thresh", "free_thresh"})
"""Of map_server's header: any of them makes a map, so that what it lacks is said of a map."""
_TOP_KEY = re.compile(r"""^["']?(\w{1,31})["']?[ \t]{0,20}:(?=\s|$)""", re.MULTILINE)


def is_yaml(path: Path) -> bool:
    """Tell whether a name is that of a YAML file."""
    return path.suffix.lower() in {".yaml", ".yml"}


def kind_of_yaml(path: Path) -> YamlKind:
    """Return what a file is: a building, a map, or else a door database.

    Only its uppermost keys are looked at; who reads the file says what is wrong with the rest.

    Raises:
        FormatError: It cannot be read; or it is a nav graph, which has keys of a building.
    """
    keys = _top_keys(path)
    if any(key.isdecimal() for key in keys):  # the ids of doors
        return "doors"
    if {"levels", "doors", "building_name"} <= keys:
        raise FormatError(
            path, "this is a nav graph, which Open-RMF made of a building; import the building, "
            "*.building.yaml: it has the walls, too",
        )  # fmt: skip
    if "levels" in keys:
        return "building"
    return "map" if keys & MAP_KEYS else "doors"


def _top_keys(path: Path) -> set[str]:
    """Return the keys of a file's outermost mapping.

    In block style they are those that begin a line: then nothing has to be parsed.
    """
    text = decode_utf8(read_capped(path, most_bytes=MOST_BYTES), path)
    if not text.lstrip().startswith("{"):
        return set(_TOP_KEY.findall(text))
    root = parse_yaml(text.encode(), path, takes_nan=True)
    return set(root.entries) if isinstance(root, Mapping) else set()
